#pragma once

#include <diracstep/core/integrator/integrator_options.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <vector>

namespace diracstep {

/// A scene as it is stepped, and what was done to it.
struct PreparedScene {
  std::shared_ptr<const Scene> scene;
  std::vector<PlanLine> lines;
};

/// The scene itself, or a copy without the rows that are redundant at its start and at poses around it, which
/// keeps all of them in Scene::whole; their forces are forces_of_whole().  Throws Misuse, with the names, for
/// rows that contradict or nearly depend on others, for those that depend on others in another way
/// (why_not_left_out()), and for all redundant ones where the scene refuses them and `also_refused` is false.
std::shared_ptr<const Scene> with_independent_rows(const std::shared_ptr<const Scene>& scene,
                                                   bool also_refused = false);

/// Completes the scene, leaves out redundant rows (with_independent_rows()), adds the rows that a degenerate
/// Lagrangian hides, and, where the options ask for it, moves the start onto the constraints.  Throws Misuse
/// for a bad scene, for redundant rows as with_independent_rows(), for rows and motions of first order that
/// are not determined (require_regular_rows(), require_determined()), and for an inconsistent start unless
/// the options say otherwise.
PreparedScene prepared(std::shared_ptr<const Scene> given, const IntegratorOptions& options,
                       const SolverFactory& solvers);

/// A completed scene with the velocities of its start that are no data of a motion
/// (PointReader::determine()), or as it is where there are none or they are not found, which the steps tell.
std::shared_ptr<const Scene> with_determined_start(std::shared_ptr<const Scene> scene,
                                                   const SolverFactory& solvers);

}  // namespace diracstep
