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

/// Completes the scene, adds the rows that a degenerate Lagrangian hides, and, where the options ask for it,
/// drops redundant rows and moves the start onto the constraints.  Throws Misuse for a bad scene, for rows
/// and motions of first order that are not determined (require_regular_rows(), require_determined()), and for
/// redundant rows or an inconsistent start unless the options say otherwise.
PreparedScene prepared(std::shared_ptr<const Scene> given, const IntegratorOptions& options,
                       const SolverFactory& solvers);

/// A completed scene with the velocities of its start that are no data of a motion
/// (PointReader::determine()), or as it is where there are none or they are not found, which the steps tell.
std::shared_ptr<const Scene> with_determined_start(std::shared_ptr<const Scene> scene,
                                                   const SolverFactory& solvers);

}  // namespace diracstep
