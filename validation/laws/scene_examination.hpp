#pragma once

#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// One thing that was looked at.
struct Finding {
  std::string what;
  bool passed = true;
  std::string detail;  ///< numbers; where it failed, what to do
};

/// Every derivative of the scene's functions against central differences, along one direction, at the start
/// and near it: gradients, second derivatives, rates, of L or H, of the rows and of the force.
std::vector<Finding> examine_derivatives(const Scene& scene);

/// Dimensions, rank of the rows, consistency of the start, derivatives, regularity of a step, and the reading
/// of velocities from momenta.
struct Examination {
  std::vector<Finding> findings;
  std::vector<std::string> advice;  ///< on the method

  bool passed() const;
};
Examination examine(const CatalogueScene& entry, const Registry& registry, const SolverFactory& solvers);

}  // namespace diracstep
