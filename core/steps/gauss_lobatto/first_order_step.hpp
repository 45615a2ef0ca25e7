#pragma once

#include <diracstep/core/steps/step_problem.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <memory>

namespace diracstep {

/// Gauss collocation with s stages of a Lagrangian with motions of first order (first_order_motions.hpp),
/// with rows and forces.  Unknowns: stage velocities V_1 … V_s and forces of the rows Λ_1 … Λ_s, and, where
/// there are holonomic rows with the one-forms A_h, a projection κ and its way ζ at the end, with
///
///   Q_i = q0 + A_h(q0)ᵀκ + h Σ_k a_ik V_k,   G_i = ∂L/∂q + f + AᵀΛ_i at (Q_i,V_i)
///
///   0 = Uᵀ[∂L/∂v(Q_i,V_i) − p0 − h Σ_j a_ij G_j]                          motions with inertia
///   0 = h Wᵀ[(∂²L/∂v∂q) V + ∂²L/∂v∂t − G]_i                               motions of first order
///   0 = A(Q_i) V_i + b(Q_i)                                               rows of both kinds
///   q1 = q0 + A_h(q0)ᵀκ + h Σ b_k V_k + ζ,   0 = ζ − A_h(q1)ᵀκ,   0 = φ(q1)/h
///   Uᵀp1 = Uᵀ[p0 + h Σ b_j G_j],   Wᵀp1 = Wᵀ ∂L/∂v(q1)
///
/// Velocities and Λ are functions of (q, Uᵀp), so this is the Gauss method for these: of order 2s,
/// self-adjoint, with Wᵀ(p − ∂L/∂v) = 0 and φ = 0 to round-off at both ends; κ = O(h^{2s+1}).  It is no
/// variational step: a one-form dθ with constant coefficients without rows and forces is kept, others only on
/// average where the motion is reversible.  The variational step of phase-space Lagrangians
/// (phase_space_step.hpp), with multipliers and forces put into its momenta, has the order s or s + 1 only,
/// as measured.
///
/// Throws Misuse unless 1 ≤ s ≤ 20, for more than 1500 coordinates and rows, and where velocities or Λ are
/// not determined at the start, with the directions that are open (require_determined()).
std::unique_ptr<StepProblem> first_order_step(int s, const Scene& scene, const FirstOrderMotions& motions);

}  // namespace diracstep
