#pragma once

#include <diracstep/core/system/scene.hpp>
#include <diracstep/validation/references/reference_run.hpp>
#include <vector>

namespace diracstep {

/// The formulations that differ for a scene: without rows there is one, and two without holonomic ones.
std::vector<DaeFormulation> formulations_of(const Scene& scene);

/// Integrates the system of implicit_lagrangian_dae.hpp, in the formulation of the options, from the scene's
/// start to `t_end` with SUNDIALS IDA and the analytic Jacobian. The start is made consistent by the
/// acceleration system of core. Throws Misuse for a bad scene, start, end or option; what a user's function
/// throws passes through.
ReferenceRun integrate_with_ida(const Scene& scene, double t_end, const ReferenceOptions& options);

}  // namespace diracstep
