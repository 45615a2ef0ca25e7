#pragma once

#include <diracstep/core/steps/step_problem.hpp>

namespace diracstep {

/// GL(s) on a configuration space of Lie groups and spheres (Scene::space), order 2s, self-adjoint,
/// symplectic without rows and forces; where L is invariant its momentum map is kept.  GL(1) is the midpoint
/// step.
///
/// Unknowns are the stage velocities V_1 … V_s and multipliers λ_0 … λ_{s−1} (impulses b~_j λ_j), s (n + m)
/// as in R^n.  With the coefficients of tableau.hpp, the retraction τ, dτ_x v = τ(x)⁻¹ d/dε τ(x + εv), D_x(v)
/// = ∂(dτ_x v)/∂x, and the chart of a step centred in its middle,
///
///   y = h/2 Σ b_k V_k,   g_c = g0 τ(y),   g1 = g_c τ(y)
///   X_i = −y + h Σ a_ik V_k,   G_i = g_c τ(X_i),   Ξ_i = dτ_{X_i} V_i                 Gauss nodes
///   X~_j = −y + h Σ a~_jk V_k,   G~_j = g_c τ(X~_j)                                   Lobatto nodes
///   π_i, F_i = ∂L/∂ξ, ∂L/∂g + f at (G_i, Ξ_i),   φ_i = D_{X_i}(V_i)ᵀ π_i + dτ_{X_i}ᵀ F_i,   c_j = A(G~_j)ᵀ
///   λ_j M = Ad_{τ(y)}ᵀ p0 + h Σ b_i Ad_{τ(−X_i)}ᵀ F_i + Σ_{j<s} b~_j Ad_{τ(−X~_j)}ᵀ c_j,   p1 = Ad_{τ(y)}ᵀ M
///
/// the equations are, for k = 1 … s,
///
///   dτ_{X_k}ᵀ π_k + h Σ_i (b_i/b_k)(a_ik − b_k/2) φ_i + Σ_{j<s} (b~_j/b_k)(a~_jk − b_k/2) dτ_{X~_j}ᵀ c_j
///     = ½ dτ_{−y}ᵀ (p0 + M)
///   A(G_k) Ξ_k + b = 0 for nonholonomic rows,   φ(G~_k)/h = 0 for holonomic ones
///
/// They follow from the stationarity of h Σ b_i ℓ(G_i, Ξ_i) with the virtual work of forces and impulses
/// under variations of g0 and of all V_k with g1 fixed; that the centre varies with them makes the step
/// symplectic. The Jacobian is exact: derivatives of dτ in closed form or by jets, all others from those of
/// L, force and rows. Where neither L nor the rows depend on the configuration and there is no force, these
/// are equations in V and λ alone and the configuration is reconstructed at the end (Euler-Poincaré,
/// Euler-Poincaré-Suslov). A step that leaves what τ is injective on has no residual: the solve fails and
/// failure() says why.
std::unique_ptr<StepProblem> group_step(int s, const Scene& scene);

/// Whether the step of such a scene is one of its velocities and multipliers alone.
bool reduced_on_group(const Scene& scene);

}  // namespace diracstep
