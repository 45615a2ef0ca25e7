#pragma once

#include <Eigen/QR>
#include <diracstep/core/numerics/balance.hpp>
#include <functional>
#include <string>

namespace diracstep {

/// A matrix with its rows and columns scaled by balance(), and its solutions of least norm in these units.
class BalancedMatrix {
 public:
  explicit BalancedMatrix(Columns matrix);

  Columns solve(const Columns& right) const;
  /// In the units of the columns.
  double norm(const Vector& x) const { return x.cwiseQuotient(by_.columns).norm(); }
  /// How large the largest of x is in each row.
  Vector sizes_in_rows(const Vector& x) const;

 private:
  Balance by_;
  Eigen::CompleteOrthogonalDecomposition<Columns> factors_;
};

/// How solve_monotonically() ends: `failure` is empty, or says why; `iterations` are those done.
struct MonotoneNewton {
  std::string failure = {};
  int iterations = 0;
};

/// Newton's method with full matrices for equations far from their solution, such as those of diodes, whose
/// currents grow by e each 26 mV: F(x) = 0 with ∂F/∂x at the point where F was taken last.
/// Steps are damped by the natural monotonicity test (Deuflhard, Newton Methods for Nonlinear Problems, 2004,
/// 3.3), which does not depend on the units of equations; singular and over-determined systems are solved in
/// least squares, so that a solution may leave a residual.
MonotoneNewton solve_monotonically(const std::function<Vector(const Vector&)>& residual,
                                   const std::function<Columns(const Vector&)>& jacobian, Vector& x);

}  // namespace diracstep
