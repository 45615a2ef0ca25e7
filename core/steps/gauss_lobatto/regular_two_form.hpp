#pragma once

#include <diracstep/core/system/scene.hpp>

namespace diracstep {

/// Throws Misuse where dθ of L = θ(q)·v − H(q) has no full rank at the start: then the equations leave some
/// velocities open, and the Lagrangian is not degenerate but wrong, or needs rows.  Scenes of more than 1000
/// coordinates are not looked at, since the test takes full matrices.
void require_regular_two_form(const Scene& scene);

}  // namespace diracstep
