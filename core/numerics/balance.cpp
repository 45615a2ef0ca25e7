#include <cmath>
#include <diracstep/core/numerics/balance.hpp>

namespace diracstep {

Balance balance(Columns& matrix) {
  constexpr int rounds = 12;
  const auto scale = [](double largest) { return largest > 0.0 ? 1.0 / std::sqrt(largest) : 1.0; };
  Balance by{Vector::Ones(matrix.rows()), Vector::Ones(matrix.cols())};
  if (matrix.size() == 0) return by;
  for (int k = 0; k < rounds; ++k) {
    const Vector r = matrix.cwiseAbs().rowwise().maxCoeff().unaryExpr(scale);
    const Vector c = matrix.cwiseAbs().colwise().maxCoeff().transpose().unaryExpr(scale);
    matrix = r.asDiagonal() * matrix * c.asDiagonal();
    by.rows = by.rows.cwiseProduct(r);
    by.columns = by.columns.cwiseProduct(c);
  }
  return by;
}

}  // namespace diracstep
