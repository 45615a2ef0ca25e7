#pragma once

#include <diracstep/core/steps/step_problem.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <memory>

namespace diracstep {

/// The Gauss method with s stages of a Lagrangian whose constraints have several levels
/// (core/system/detail/constraint_levels.hpp: K, g, z = (q, p_i), w = (v, Λ)), between projections onto all
/// constraints C(t,z) = 0.  Unknowns: w_1 … w_s, w_e at the end, rates D_1 … D_s of the momenta p_i, a shift
/// y and ν, one number a constraint.  With rates d_j = (v of w_j, D_j) and
///
///   Z_i = z0 + y + h Σ_j a_ij d_j,   z1 = z0 + 2y + h Σ_j b_j d_j,
///
///   0 = K(Z_i,w_i),   0 = K(z1,w_e),   0 = D_i − g(Z_i,w_i)_i,   0 = C(z1)/h,
///   0 = (y − Σ_i b_i (∂C/∂z)ᵀ(Z_i,w_i) ν)/h.
///
/// K determines w at each point, so this is the Gauss method on an ordinary differential equation that keeps
/// C, of order 2s; exchanging the ends turns y and ν around, so it is self-adjoint.  Constraints and p =
/// ∂L/∂v hold to round-off at both ends.  It is no variational step.
///
/// Throws Misuse unless 1 ≤ s ≤ 20, and where velocities or Λ are not determined at the start.
std::unique_ptr<StepProblem> levelled_step(int s, const Scene& scene, const FirstOrderMotions& motions);

}  // namespace diracstep
