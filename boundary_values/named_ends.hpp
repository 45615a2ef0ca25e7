#pragma once

#include <diracstep/boundary_values/optimal_control.hpp>
#include <map>
#include <string>
#include <vector>

namespace diracstep {

/// Numbers by name, each in its unit.
using NamedNumbers = std::map<std::string, double>;

/// What can be asked of an end, in the order of the columns of BoundaryConditions: x, …, v_x, …, p_x, ….
std::vector<std::string> names_at_an_end(const Scene& scene);

/// What is asked of both ends by these names; where nothing is asked of the start its coordinates are those
/// of the scene.  Throws Misuse for names that are none, and numbers that are not finite.
BoundaryConditions conditions_at_ends(const Scene& scene, const NamedNumbers& start, const NamedNumbers& end);

/// The same with all coordinates and velocities of the scene's start, which is complete.
BoundaryConditions conditions_from_start(const Scene& scene, const NamedNumbers& end);

/// Bounds, by name, of coordinates at the ends of the steps and of controls.  Throws Misuse for names that
/// are none.
void set_bounds(ControlProblem& problem, const NamedNumbers& least, const NamedNumbers& greatest);

}  // namespace diracstep
