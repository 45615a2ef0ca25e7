#pragma once

#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// Growth of the two linear test equations over one step.
struct GrowthPoint {
  double step = 0.0;        ///< hω of the oscillator, hγ of the damped mass
  double oscillator = 0.0;  ///< spectral radius of the step of L = v²/2 − q²/2; NaN where the step failed
  double damping = 0.0;  ///< |p1/p0| of L = v²/2 under f = −v; NaN where the step failed or takes no force
};

/// Linear stability of one method: (q,p) after a step is M(hω) (q,p), and p after a step is R(hγ) p.
struct LinearStability {
  std::string method;
  int order = 0;
  double oscillator_limit = 0.0;  ///< largest hω up to which the spectral radius of M stays at 1
  double damping_limit = 0.0;  ///< largest hγ up to which |R| ≤ 1; NaN for a method that takes no forces
  std::vector<GrowthPoint> growth;  ///< twenty points a decade from 1e-2 to largest_tested_step
};

/// Limits are looked for up to here; a limit of this size says that none was found.
inline constexpr double largest_tested_step = 1e6;

/// A radius above 1 + growth_tolerance counts as growth.  M has the double eigenvalue −1 where hω goes to
/// infinity, and the radius of a double eigenvalue is known to the square root of round-off only.
inline constexpr double growth_tolerance = 1e-5;

/// Measures one method by steps of the integrator itself: 40 steps a decade, the peaks between them climbed
/// in search of poles, then bisection within the first interval that shows growth.  A window of growth
/// without a peak on that grid is missed where it is narrower than 6 % of hω.  Throws Misuse for an unknown
/// method and an order it cannot be composed to.
LinearStability linear_stability(const Registry& registry, const SolverFactory& solvers,
                                 const std::string& method, int order);

}  // namespace diracstep
