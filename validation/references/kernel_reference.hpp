#pragma once

#include <diracstep/core/system/first_order_motions.hpp>
#include <diracstep/validation/references/reference_run.hpp>

namespace diracstep {

/// SUNDIALS IDA on a Lagrangian with hidden equations that hold velocities (core/system/kernel_motions.hpp),
/// whose own system p = ∂L/∂v is of index 3:  in (q, p, v, Λ), of index 1,
///
///   q̇ = v,   ṗ = ∂L/∂q + f + AᵀΛ,   0 = the equations of KernelVelocityProblem for (v, Λ) at (t, q, p).
///
/// The hidden equations enter differentiated, so that a numerical solution drifts off them within its
/// tolerance. Options but tolerances and steps do not matter.
ReferenceRun integrate_kernel_with_ida(const Scene& scene, const FirstOrderMotions& motions, double t_end,
                                       const ReferenceOptions& options);

}  // namespace diracstep
