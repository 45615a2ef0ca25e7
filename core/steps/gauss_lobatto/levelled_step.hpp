#pragma once

#include <diracstep/core/steps/step_problem.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <memory>

namespace diracstep {

/// The Gauss method with s stages of a Lagrangian whose constraints have levels
/// (core/system/detail/constraint_levels.hpp: z' = g(t,z), z = (q, p_i), φ and C(t,z) = 0), between
/// projections onto all constraints.  Unknowns: rates d_1 … d_s of z, ν, one number a constraint, and ζ, its
/// way at the end.  With C' = ∂(φ,C)/∂z and
///
///   Z_i = z0 + C'(z0)ᵀν + h Σ_j a_ij d_j,   z1 = z0 + C'(z0)ᵀν + h Σ_j b_j d_j + ζ,
///
///   0 = d_i − g(Z_i),   0 = (ζ − C'(z1)ᵀν)/h,   0 = φ(z1)/h,   0 = C(z1)/h.
///
/// g determines v and Λ at each point, so this is the Gauss method on an ordinary differential equation that
/// keeps the constraints, of order 2s; exchanging the ends turns ν around and swaps the two ways, so it is
/// self-adjoint.  Constraints and p = ∂L/∂v hold to round-off at both ends.  It is no variational step.
///
/// The start of a step is the end of the one before, whose W it leaves in the StepMemory with the reach of
/// its differences.  Throws Misuse unless 1 ≤ s ≤ 20, and where v or Λ are not determined at the start.
std::unique_ptr<StepProblem> levelled_step(int s, const Scene& scene, const FirstOrderMotions& motions);

}  // namespace diracstep
