#pragma once

#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/validation/laws/derivative_examination.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// What a run would meet: dimensions, rank of the rows, consistency of the start, derivatives at the start
/// and along the motion, H against L, the first 16 steps with the recommended method or the library's choice,
/// the reading of velocities from momenta, and of a scene with events up to 2000 steps through them.
struct Examination {
  std::vector<Finding> findings;
  std::vector<std::string> advice;  ///< on the method

  bool passed() const;
};
Examination examine(const CatalogueScene& entry, const Registry& registry, const SolverFactory& solvers);

}  // namespace diracstep
