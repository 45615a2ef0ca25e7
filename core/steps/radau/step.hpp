#pragma once

#include <diracstep/core/steps/step_problem.hpp>
#include <memory>

namespace diracstep {

/// The stages of Radau IIA for q and p alike in the implicit Lagrangian system
///
///   q̇ = v + A_hᵀμ,   p = ∂L/∂v,   ṗ = ∂L/∂q + f + AᵀΛ,   A v + b = 0,   φ = 0,
///
/// which damps what is too fast for a step, |R(∞)| = 0, and ends on all rows.  Order 2s − 1 in q and p on
/// unconstrained, holonomic, nonholonomic and mixed scenes, with forces, time and Lagrangians that are
/// degenerate or linear in v: a differential-algebraic system of index 2 at most (Hairer, Lubich, Roche, The
/// Numerical Solution of Differential-Algebraic Systems by Runge–Kutta Methods, 1989).  φ = 0 has its rate
/// among the rows A v + b = 0 and a second multiplier μ, zero along the motion (Gear, Gupta, Leimkuhler, J.
/// Comput. Appl. Math. 12, 1985); A_h are the one-forms of the holonomic rows at the start of the step, along
/// which μ may move a stage as well as along those of the stage.  Neither symplectic nor reversible, and of
/// no generating function.
///
/// Unknowns: velocities V_i (n each), impulses λ_j = hΛ_j (m each) and w_i = Σ_j a_ij μ_j (m_h each, a
/// velocity), i, j = 1 … s.  With Q_i = q0 + h Σ_j a_ij V_j + h A_h(q0)ᵀ w_i:
///
///   momentum, velocity rows, position rows
///     0 = ∂L/∂v(Q_i,V_i) − p0 − Σ_j a_ij [h (∂L/∂q + f)(Q_j,V_j) + A(Q_j)ᵀ λ_j]
///     0 = A(Q_i) V_i + b(Q_i)
///     0 = φ(Q_i)/h
///
///   q1 = Q_s,   p1 = ∂L/∂v(Q_s,V_s)
///
/// The impulse at q0 is zero: p0 is the momentum of a velocity of the distribution.
///
/// Throws Misuse unless 1 ≤ s ≤ 5, where there is no Lagrangian, and for a two-form dθ, or equations of
/// motions of first order (first_order_motions.hpp), that do not determine velocities at the start.
std::unique_ptr<StepProblem> radau_step(int s, const Scene& scene, bool dense);

}  // namespace diracstep
