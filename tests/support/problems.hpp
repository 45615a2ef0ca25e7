#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <functional>
#include <utility>
#include <vector>

namespace diracstep::testing {

/// A nonlinear problem from two functions that fill the residual and the values of the Jacobian on the
/// pattern.
class FunctionProblem final : public NonlinearProblem {
 public:
  using Fill = std::function<void(ConstVectorRef x, VectorRef out)>;

  FunctionProblem(SparsityPattern pattern, std::vector<ResidualBlock> blocks, Fill residual, Fill jacobian)
      : pattern_(std::move(pattern)),
        blocks_(std::move(blocks)),
        residual_(std::move(residual)),
        jacobian_(std::move(jacobian)) {}

  /// One unknown.
  FunctionProblem(double (*f)(double), double (*derivative)(double), double scale = 1.0)
      : FunctionProblem(
            SparsityPattern::dense(1, 1), {{"row", 1, scale}},
            [f](ConstVectorRef x, VectorRef out) { out[0] = f(x[0]); },
            [derivative](ConstVectorRef x, VectorRef out) { out[0] = derivative(x[0]); }) {}

  int size() const override { return pattern_.rows(); }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }
  void residual(ConstVectorRef x, VectorRef f) override { residual_(x, f); }
  void jacobian(ConstVectorRef x, VectorRef values) override { jacobian_(x, values); }

 private:
  SparsityPattern pattern_;
  std::vector<ResidualBlock> blocks_;
  Fill residual_, jacobian_;
};

/// M x = b on the pattern of M's entries, or in full; a block for each row.
inline FunctionProblem linear(const Eigen::MatrixXd& m, const Vector& b, const std::vector<double>& scales,
                              bool dense = true) {
  const int n = static_cast<int>(b.size());
  std::vector<ResidualBlock> blocks;
  for (const double scale : scales) blocks.push_back({"row", 1, scale});
  std::vector<std::pair<int, int>> entries;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i)
      if (dense || m(i, j) != 0.0) entries.emplace_back(i, j);
  const SparsityPattern pattern(n, n, entries);
  return {pattern, blocks, [m, b](ConstVectorRef x, VectorRef f) { f = m * x - b; },
          [m, entries](ConstVectorRef, VectorRef values) {
            Eigen::Index k = 0;
            for (const auto& [i, j] : entries) values[k++] = m(i, j);
          }};
}

}  // namespace diracstep::testing
