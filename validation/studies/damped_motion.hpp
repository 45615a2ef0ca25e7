#pragma once

#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <optional>

namespace diracstep {

/// Where the motion to `t_end` is damped so that damped/radau:3 is the default (DampingSurvey): the largest
/// |q|, |v| and |p| of each coordinate along it, one below the other, from steps by local errors of 1e-4.
/// Absolute tolerances of a baseline are parts of these: charges of 1e-6 C beside rtol = 1e-6 would not be
/// solved for at all.  Empty for other motions, and where that run does not come to the end.
std::optional<Vector> sizes_where_damped(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                                         const SolverFactory& solvers, double t_end, double step);

}  // namespace diracstep
