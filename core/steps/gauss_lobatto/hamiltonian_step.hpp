#pragma once

#include <diracstep/core/steps/step_problem.hpp>
#include <memory>

namespace diracstep {

/// GL(s) of a Hamiltonian in its own right, which may be degenerate: nothing is inverted, and no Lagrangian
/// stands behind it.  Unknowns: stage velocities V_1 … V_s, stage momenta P_1 … P_s and impulses λ_0 …
/// λ_{s−1} at the Lobatto nodes, with
///
///   Q_i = q0 + h Σ_k a_ik V_k,   Q~_j = q0 + h Σ_k a~_jk V_k
///
///   momentum, i = 1…s
///     0 = P_i − p0 − h Σ_j â_ij [−∂H/∂q(Q_j,P_j) + f(Q_j,V_j)] − Σ_{j<s} e_ij A(Q~_j)ᵀ λ_j
///   velocity, i = 1…s
///     0 = V_i − ∂H/∂p(Q_i,P_i)
///   holonomic and nonholonomic rows, j = 1…s
///     0 = φ(Q~_j)/h,   0 = A(Q_j) V_j + b(Q_j)
///
///   q1 = Q~_s,   p1 = p0 + h Σ b_j [−∂H/∂q + f]_j + Σ_{j<s} b~_j A(Q~_j)ᵀ λ_j
///
/// The end is projected where it is read: A ∂H/∂p(q1, p1 + Aᵀμ) + b = 0, v = ∂H/∂p.  Order 2s and
/// self-adjoint for unconstrained, holonomic, nonholonomic and mixed scenes with forces, affine and
/// time-dependent rows; regular for small h where A ∂²H/∂p² Aᵀ is.  Where ∂²H/∂p² is regular it is the step
/// gauss_lobatto_step() of the Lagrangian of H.
///
/// It is the Galerkin Hamiltonian integrator of Leok and Zhang (IMA J. Numer. Anal. 31, 2011) on Gauss nodes,
/// with the rows at the nodes of the Gauss–Lobatto SPARK methods (Jay, SIAM J. Numer. Anal. 45, 2007).
///
/// Throws Misuse unless 1 ≤ s ≤ 20.  That A ∂²H/∂p² Aᵀ is regular is asked where a scene is prepared
/// (require_regular_rows()).
std::unique_ptr<StepProblem> hamiltonian_step(int s, const Scene& scene, bool dense);

}  // namespace diracstep
