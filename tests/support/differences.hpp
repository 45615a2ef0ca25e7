#pragma once

#include <Eigen/Dense>
#include <diracstep/core/numerics/nonlinear_solver.hpp>

namespace diracstep::testing {

/// Jacobian of g at x by central differences: error about 1e-9 for functions and arguments of size 1.
template <class G>
Eigen::MatrixXd difference_jacobian(G g, const Vector& x, double delta = 1e-5) {
  Eigen::MatrixXd jacobian;
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    Vector forward = x, backward = x;
    forward[j] += delta;
    backward[j] -= delta;
    const Vector column = (g(forward) - g(backward)) / (2.0 * delta);
    if (jacobian.size() == 0) jacobian.resize(column.size(), x.size());
    jacobian.col(j) = column;
  }
  return jacobian;
}

/// A full matrix from values on a pattern.
inline Eigen::MatrixXd full(const SparsityPattern& pattern, const Vector& values) {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(pattern.rows(), pattern.columns());
  for (int j = 0; j < pattern.columns(); ++j)
    for (int k = pattern.column_starts()[static_cast<std::size_t>(j)];
         k < pattern.column_starts()[static_cast<std::size_t>(j) + 1]; ++k)
      matrix(pattern.row_indices()[static_cast<std::size_t>(k)], j) = values[k];
  return matrix;
}

/// The largest difference between a problem's Jacobian and that by differences.
inline double jacobian_error(NonlinearProblem& problem, const Vector& x) {
  const auto residual = [&](const Vector& y) {
    Vector f(problem.size());
    problem.residual(y, f);
    return f;
  };
  Vector values(problem.pattern().nonzeros());
  problem.jacobian(x, values);
  return (full(problem.pattern(), values) - difference_jacobian(residual, x)).cwiseAbs().maxCoeff();
}

}  // namespace diracstep::testing
