#pragma once

#include <diracstep/core/dirac/step_rule.hpp>
#include <diracstep/core/steps/step_problem.hpp>

namespace diracstep {

/// The step of a discrete Lagrangian by a quadrature at the ends of a step on a configuration space of Lie
/// groups and spheres,
///
///   L_d(g0, g1) = h [w0 ℓ(g0, V) + w1 ℓ(g1, V)],   g1 = g0 τ(h V)
///
/// with w0 + w1 = 1 from `rule`: left (1, 0) and right (0, 1), which are of order 1 and each other's adjoint,
/// and trapezoidal (1/2, 1/2), of order 2 and self-adjoint.  Unknowns V and λ, with x = h V, F = ∂L/∂g + f:
///
///   P = p0 + A(g0)ᵀ λ + h w0 F(g0, V),   w0 ∂ℓ/∂ξ(g0, V) + w1 ∂ℓ/∂ξ(g1, V) = dτ_{−x}ᵀ P
///   p1 = Ad_{τ(x)}ᵀ P + h w1 F(g1, V)
///   φ(g1)/h = 0 for holonomic rows,   w0 (A V + b)(g0) + w1 (A V + b)(g1) = 0 for nonholonomic ones
///
/// With constant masses, potentials and holonomic rows the trapezoidal one is the RATTLE of Lie groups
/// (Hante, Arnold, RATTLie, J. Comput. Appl. Math. 387, 2021).
///
/// Near the diagonal it is the step of generating functions of types 2 and 3 as well, the discrete Legendre
/// transforms of L_d in the chart at g0, with the momentum P1 = dτ_xᵀ p1 there, and in that at g1, with
/// P0 = dτ_{−x}ᵀ p0:
///
///   H_{d+}(g0, P1) = stat_x  P1·x − L_d(g0, g0 τ(x))
///     x = ∂H_{d+}/∂P1,   p0 = dτ_{−x}^{−T} P1 + ∂H_{d+}/∂g0
///   H_{d−}(P0, g1) = stat_x  P0·x − L_d(g1 τ(−x), g1)
///     x = ∂H_{d−}/∂P0,   p1 = dτ_x^{−T} P0 − ∂H_{d−}/∂g1
///
/// which of left and right are symplectic Euler, H_{d+} = h H(g0, P1) and H_{d−} = h H(g1, P0).
///
/// Throws Misuse for a rule with other nodes.
std::unique_ptr<StepProblem> group_quadrature_step(const StepRule& rule, const Scene& scene);

}  // namespace diracstep
