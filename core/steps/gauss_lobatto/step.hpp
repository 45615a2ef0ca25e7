#pragma once

#include <diracstep/core/steps/step_problem.hpp>
#include <memory>

namespace diracstep {

/// GL(s), the Gauss–Lobatto Dirac step of order 2s for unconstrained, holonomic, nonholonomic and mixed
/// scenes with forces, affine and time-dependent rows; self-adjoint.  Unknowns: stage velocities V_1 … V_s
/// and impulses λ_0 … λ_{s−1} at the Lobatto nodes, with
///
///   Q_i = q0 + h Σ_k a_ik V_k,   Q~_j = q0 + h Σ_k a~_jk V_k
///
///   momentum, i = 1…s
///     0 = ∂L/∂v(Q_i,V_i) − p0 − h Σ_j â_ij [∂L/∂q(Q_j,V_j) + f_j] − Σ_{j<s} e_ij A(Q~_j)ᵀ λ_j
///
///   holonomic and nonholonomic rows, j = 1…s
///     0 = φ(Q~_j)/h,   0 = A(Q_j) V_j + b(Q_j)
///
///   q1 = Q~_s,   p1 = p0 + h Σ b_j [∂L/∂q + f]_j + Σ_{j<s} b~_j A(Q~_j)ᵀ λ_j
///
/// The multiplier at the last node is the projection of p1, which the first impulse of the next step absorbs.
/// GL(1) is the step of type1/midpoint.  The holonomic case is, in our reading, the Gauss–Lobatto SPARK
/// method of Jay (SIAM J. Numer. Anal. 45, 2007); near the nonholonomic one are Jay's Lagrange–d'Alembert
/// SPARK methods and Martín de Diego and Sato Martín de Almagro (arXiv 1810.10926).
///
/// Throws Misuse unless 1 ≤ s ≤ 20.
std::unique_ptr<StepProblem> gauss_lobatto_step(int s, const Scene& scene, bool dense);

}  // namespace diracstep
