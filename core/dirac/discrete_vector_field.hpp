#pragma once

#include <diracstep/core/dirac/dirac_structure.hpp>
#include <optional>

namespace diracstep {

/// The (+) discrete vector field X_{d+} : T*Q → T*Q×T*Q, z0 ↦ (z0,z1), of a generating function and a
/// discrete constraint: the z1 for which ((z0,z1), D⁺L_d) ∈ D_{d+}, or ((z0,z1), dH_{d±}),
///
///   ((q0, p0 + A(q0)ᵀλ), z1) ∈ graph of S,   c(q0,q1) = 0            Leok and Ohsawa (4.25), (4.32), 8.3
///
/// Computed trajectories with (+) momenta are its integral curves, (z_k,z_{k+1}) = X_{d+}(z_k): (iii) of
/// Theorems 8.4 and 10.4.  Over (Q×Q)⊕T*Q the lifted field takes (q_k,q_{k+1})⊕(q_k,p_k) to the pair of that
/// and its successor.
///
/// Newton's method from `guess` with a Jacobian by differences and full matrices, apart from the equations of
/// a step in core/steps: for looking at S, not for runs.  The result is good to about 1e-12 of its size, and
/// none where that is not reached.  Forces have no part in it.  Throws Misuse for S of type 4.
std::optional<PhasePoint> discrete_vector_field_plus(GeneratingFunction& s, DiscreteDiracStructure& structure,
                                                     Interval step, const PhasePoint& z0,
                                                     const PhasePoint& guess);

/// The (−) discrete vector field X_{d−} : z1 ↦ (z0,z1): the z0 for which the pair and its differential lie in
/// D_{d−},
///
///   (z0, (q1, p1 − A(q1)ᵀλ)) ∈ graph of S,   c(q0,q1) = 0            (4.42), (4.49), 8.3
///
/// with φ(t0,q0) = 0 for holonomic rows, which say nothing of q0 otherwise.  Trajectories with (−) momenta
/// are its integral curves, (z_k,z_{k+1}) = X_{d−}(z_{k+1}).
std::optional<PhasePoint> discrete_vector_field_minus(GeneratingFunction& s,
                                                      DiscreteDiracStructure& structure, Interval step,
                                                      const PhasePoint& z1, const PhasePoint& guess);

}  // namespace diracstep
