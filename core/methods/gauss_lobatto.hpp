#pragma once

#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/system/phase_function.hpp>
#include <memory>

namespace diracstep {

/// GL(s) as a generating function of type 1, 2 or 3: the Galerkin discrete Lagrangian on polynomials of
/// degree s with the s Gauss nodes, and its discrete Legendre transforms, stationary in the inner columns
///
///   one    S1(q0,q1) = h Σ b_i L(Q_i,V_i) + μ·(q1 − q0 − h Σ b_i V_i)      inner V_1 … V_s, μ
///   two    S2(q0,p1) = p1·q1 − h Σ b_i L(Q_i,V_i),   q1 = q0 + h Σ b_i V_i        inner V_1 … V_s
///   three  S3(p0,q1) = −p0·q0 − h Σ b_i L(Q_i,V_i),  q0 = q1 − h Σ b_i V_i        inner V_1 … V_s
///
/// with Q_i = q0 + h Σ a_ik V_k; at a stationary point μ = p1.  So they have nothing to invert, like the
/// transforms of Leok and Ohsawa (9.6), (9.7), which they are.
///
/// On scenes without rows the step of each of the three is GL(s) itself.  Rows and forces act at nodes inside
/// the step, which no function of the end points knows: those scenes are stepped by gauss_lobatto_step(), and
/// a step is a critical point of S under the virtual work of the inner impulses F_j = b~_j A(Q~_j)ᵀλ_j,
///
///   ∂S/∂V_k = ± h Σ_j a~_jk F_j  (minus for type one),   p̂0 = p0 + Σ_j F_j,
///
/// with (q0,p̂0), (q1,p1) on the graph of S.
///
/// Throws Misuse for type four, and unless 1 ≤ s ≤ 20.
std::unique_ptr<GeneratingFunction> gauss_lobatto_function(GeneratingType type, int s,
                                                           std::shared_ptr<const Lagrangian> lagrangian);

}  // namespace diracstep
