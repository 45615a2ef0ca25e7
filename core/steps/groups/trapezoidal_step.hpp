#pragma once

#include <diracstep/core/steps/step_problem.hpp>

namespace diracstep {

/// The trapezoidal step on a configuration space of Lie groups and spheres, order 2 and self-adjoint: that of
/// L_d = h/2 [ℓ(g0, V) + ℓ(g1, V)] with g1 = g0 τ(h V).  Unknowns V and λ, with x = h V, F = ∂L/∂g + f:
///
///   P = p0 + A(g0)ᵀ λ + h/2 F(g0, V),   ½ [∂ℓ/∂ξ(g0, V) + ∂ℓ/∂ξ(g1, V)] = dτ_{−x}ᵀ P
///   p1 = Ad_{τ(x)}ᵀ P + h/2 F(g1, V)
///   φ(g1)/h = 0 for holonomic rows,   ½ [(A V + b)(g0) + (A V + b)(g1)] = 0 for nonholonomic ones
///
/// With constant masses, potentials and holonomic rows it is the RATTLE of Lie groups (Hante, Arnold,
/// RATTLie, J. Comput. Appl. Math. 387, 2021).
std::unique_ptr<StepProblem> group_trapezoidal_step(const Scene& scene);

}  // namespace diracstep
