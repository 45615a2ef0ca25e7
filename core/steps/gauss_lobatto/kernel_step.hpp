#pragma once

#include <diracstep/core/steps/step_problem.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <memory>

namespace diracstep {

/// Gauss-Lobatto collocation with s stages of a Lagrangian whose kernel of ∂²L/∂v² moves or whose equations
/// along it hide some (kernel_motions.hpp: E, r, i, `hidden`), with rows and forces.  Unknowns: rates D_1 …
/// D_s of q, forces Λ_1 … Λ_s of the rows and, where there are holonomic rows with the one-forms A_h, their
/// projections κ_1 … κ_s, all at the Gauss nodes; velocities X_1 … X_s at the Lobatto nodes, where those
/// along the kernel, on which nothing depends there, are that of the start.  With
///
///   Q_i = q0 + h Σ_k a_ik D_k,   V_i = D_i − A_h(Q_i)ᵀκ_i,   F_i = ∂L/∂q + f + AᵀΛ_i at (Q_i,V_i),
///   Q~_j = q0 + h Σ_k a~_jk D_k,   P~_j = p0 + h Σ_k a~_jk F_k,
///
///   0 = ∂L/∂v(Q_i,V_i) − p0 − h Σ_k a_ik F_k     components `inert`
///   0 = those of E, r at (Q_i,V_i,Λ_i) that are not hidden
///   0 = ∂L/∂v(Q~_j,X_j) − P~_j                   components `inert`
///   0 = those of E/h, r/h at (Q~_j,X_j) that are hidden,   0 = φ(Q~_j)/h
///   q1 = Q~_s,   p1 = ∂L/∂v(Q~_s,X_s)
///
/// This is collocation of a system of index 2 whose differential part holds at the Gauss and whose
/// constraints hold at the s + 1 Lobatto nodes, the start being one of them.  What is left of either is
/// integrated against smooth functions by the quadrature of its own nodes, so that the end is of order 2s;
/// exchanging the ends exchanges the nodes, so it is self-adjoint.  Rows, hidden equations and p = ∂L/∂v hold
/// to round-off at both ends.  It is no variational step.
///
/// Throws Misuse unless 1 ≤ s ≤ 20, and where velocities or Λ are not determined at the start, with the
/// directions that are open (require_determined()).
std::unique_ptr<StepProblem> kernel_step(int s, const Scene& scene, const FirstOrderMotions& motions);

}  // namespace diracstep
