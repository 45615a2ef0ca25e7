#pragma once

#include <diracstep/core/integrator/prepared_scene.hpp>
#include <diracstep/core/integrator/sample.hpp>

namespace diracstep {

/// A start as the first step takes it.
struct SolvedStart {
  PreparedScene prepared;  ///< the scene with its hidden rows and without redundant ones, and what was done
  Sample sample;           ///< p projected
  Vector acceleration;     ///< dv/dt; empty where there is none: L is linear in v
};

/// Prepares the scene (prepared()) and solves velocities, accelerations and forces of rows at its start.
/// Throws Misuse as prepared() does, and Error where they are not found.
SolvedStart solved_start(const std::shared_ptr<const Scene>& given, const IntegratorOptions& options,
                         const SolverFactory& solvers);

}  // namespace diracstep
