#pragma once

#include <diracstep/boundary_values/boundary_values.hpp>
#include <string>

namespace diracstep {

/// Of a motion found between two places, by a search with twice as many steps from it: empty, or why it is
/// not to be believed.  A solution of the discrete equations that is near no motion changes with the steps.
std::string doubt_of_steps(BoundaryProblem problem, const BoundaryReport& found);

/// Between two places, by a search from another guess, the motion from the scene's start: empty, or that it
/// leads to another motion.
std::string other_motion(BoundaryProblem problem, const BoundaryReport& found);

}  // namespace diracstep
