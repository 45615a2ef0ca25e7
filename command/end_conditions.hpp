#pragma once

#include <diracstep/boundary_values/boundary_values.hpp>
#include <string>
#include <vector>

namespace diracstep::command {

/// Columns of q, v and p as conditions name them: x, v_x, p_x.
std::vector<std::string> names_at_an_end(const Scene& scene);

/// Conditions from --from and --to, NAME=VALUE each, in the order of BoundaryConditions; without any of the
/// start its coordinates are those of the scene.  Throws Misuse for names that are none.
BoundaryConditions conditions_at_ends(const Scene& scene, const std::vector<std::string>& from,
                                      const std::vector<std::string>& to);

/// The coordinate and the velocity of the scene's start, all of them, and --to.
BoundaryConditions conditions_from_start(const Scene& scene, const std::vector<std::string>& to);

}  // namespace diracstep::command
