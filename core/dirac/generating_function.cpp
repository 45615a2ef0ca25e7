#include <Eigen/LU>
#include <algorithm>
#include <diracstep/core/dirac/generating_function.hpp>

namespace diracstep {

bool make_stationary(GeneratingFunction& s, Interval step, ColumnsRef y) {
  const int n = s.dimension(), r = s.inner_columns();
  if (r == 0) return true;
  Columns g(n, s.columns()), blocks(s.pattern().nonzeros(), s.pairs());
  const auto entries = s.pattern().entries();
  for (int iteration = 0; iteration < 50; ++iteration) {
    s.gradient(step, y, g);
    s.hessian(step, y, blocks);
    Eigen::MatrixXd inner = Eigen::MatrixXd::Zero(n * r, n * r);
    for (int i = 0; i < r; ++i)
      for (int j = i; j < r; ++j)
        for (std::size_t k = 0; k < entries.size(); ++k) {
          const int row = n * i + entries[k].first, column = n * j + entries[k].second;
          inner(row, column) = inner(column, row) = blocks(static_cast<int>(k), s.pair(2 + i, 2 + j));
        }
    if (!inner.allFinite() || !g.allFinite()) return false;  // its solution would be zero
    const Vector change = inner.fullPivLu().solve(-g.rightCols(r).reshaped());
    y.rightCols(r) += change.reshaped(n, r);
    if (!change.allFinite()) return false;
    const double size = std::max(1.0, y.rightCols(r).lpNorm<Eigen::Infinity>());
    if (change.lpNorm<Eigen::Infinity>() <= 1e-9 * size) return true;  // quadratic: round-off is reached
  }
  return false;
}

}  // namespace diracstep
