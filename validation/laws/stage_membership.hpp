#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <memory>

namespace diracstep {

/// Membership of steps GL(s) in the Dirac structure of their stage space, for scenes with rows and without
/// forces.  The impulses F_j = b~_j A(Q~_j)ᵀλ_j at nodes inside a step are no part of D_{d±}; with the
/// virtual displacements δQ~_j = δq0 + h Σ_k a~_jk δV_k a step is a member when, with S the generating
/// function of type 1, 2 or 3 and its stages as inner columns,
///
///   (q0, p0 + Σ_j F_j), (q1, p1) lie on the graph of S,   ∂S/∂V_k = ± h Σ_j a~_jk F_j  (minus for type one),
///
/// φ(Q~_j) = 0 at the Lobatto nodes and A(Q_j)V_j + b = 0 at the Gauss nodes.  Largest residual over `steps`
/// steps; NaN where a step fails.  Throws Misuse for other methods.
double stage_membership_residual(const Registry& registry, const std::shared_ptr<const Scene>& scene,
                                 const IntegratorOptions& options, long steps);

}  // namespace diracstep
