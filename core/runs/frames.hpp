#pragma once

#include <diracstep/core/integrator/sample.hpp>
#include <diracstep/core/spaces/space.hpp>

namespace diracstep {

/// The end of a motion with the frames of spheres turned to those of `q`.  A frame turns about its point by
/// what depends on the steps and is never seen; without that turn, configurations and momenta are to be
/// compared. What is given where no factor is a sphere, or where the ends are too far apart to tell.
Sample in_frames_of(ConstVectorRef q, const Sample& end, const Space* space);

}  // namespace diracstep
