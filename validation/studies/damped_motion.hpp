#pragma once

#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <optional>

namespace diracstep {

/// Of a motion whose damping can be surveyed, as those of circuits with resistors.
struct SurveyedMotion {
  Vector sizes;         ///< the largest |q|, |v| and |p| of each coordinate, one below the other
  bool damped = false;  ///< so that damped/radau:3 is the default (DampingSurvey)
};

/// The motion to `t_end` by steps of Radau IIA with local errors of 1e-4.  Absolute tolerances of a baseline
/// are parts of its sizes: charges of 1e-6 C beside rtol = 1e-6 would not be solved for at all.  Empty where
/// nothing is surveyed, as without a force, and where that run does not come to the end.
std::optional<SurveyedMotion> surveyed_motion(const std::shared_ptr<const Scene>& scene,
                                              const Registry& registry, const SolverFactory& solvers,
                                              double t_end, double step);

}  // namespace diracstep
