#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/monotone_newton.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <optional>

namespace diracstep {

namespace {

constexpr int most_iterations = 300;
constexpr double singular_below = 2e-15;  // of the largest pivot; a diode that blocks has 4e-13 A/V beside 1
constexpr double shortest_part_of_step = 1e-18;  // 1 A into a diode of 1e-12 A/V is 1e12 V at first
constexpr double solved_to = 1e-14, near_round_off = 1e-9;  // |change| beside |x|

using Residual = std::function<Vector(const Vector&)>;

/// x + part·change with the longest part whose next correction, by the same matrix, is shorter.
std::optional<Vector> monotone_step(const Residual& residual, const BalancedMatrix& matrix, const Vector& x,
                                    const Vector& change) {
  const double length = matrix.norm(change);
  for (double part = 1.0; part >= shortest_part_of_step; part /= 2.0) {
    const Vector next = x + part * change, left = residual(next);
    if (!left.allFinite()) continue;
    if (matrix.norm(matrix.solve(left)) <= (1.0 - part / 4.0) * length) return next;
  }
  return std::nullopt;
}

}  // namespace

BalancedMatrix::BalancedMatrix(Columns matrix) : by_(balance(matrix)) {
  factors_.setThreshold(singular_below);
  factors_.compute(matrix);
}

Columns BalancedMatrix::solve(const Columns& right) const {
  return by_.columns.asDiagonal() * factors_.solve(Columns(by_.rows.asDiagonal() * right));
}

Vector BalancedMatrix::sizes_in_rows(const Vector& x) const {
  return max_norm(x.cwiseQuotient(by_.columns)) * by_.rows.cwiseInverse();
}

MonotoneNewton solve_monotonically(const Residual& residual,
                                   const std::function<Columns(const Vector&)>& jacobian, Vector& x) {
  for (int k = 0; k < most_iterations; ++k) {
    const Vector left = residual(x);
    const Columns slopes = jacobian(x);
    if (!left.allFinite() || !slopes.allFinite()) return {"the equations are not finite at the start", k};
    const BalancedMatrix matrix(slopes);
    const Vector change = -matrix.solve(left);
    const double length = matrix.norm(change), size = matrix.norm(x);
    if (length <= solved_to * size) return {{}, k};
    const std::optional<Vector> next = monotone_step(residual, matrix, x, change);
    if (!next && length > near_round_off * size)
      return {"Newton's method ends after " + std::to_string(k) + " iterations", k};
    if (!next || *next == x) return {{}, k};
    x = *next;
  }
  return {"not found in " + std::to_string(most_iterations) + " iterations of Newton's method",
          most_iterations};
}

}  // namespace diracstep
