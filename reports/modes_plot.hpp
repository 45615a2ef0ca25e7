#pragma once

#include <diracstep/core/equilibrium/eigenmodes.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// Writes STEM.svg and STEM.png: the eigenvalues in the complex plane, and the shapes of the first modes over
/// the coordinates, real and imaginary parts.  Empty, or what went wrong.
std::string draw_modes(const std::string& scene, const std::vector<std::string>& coordinates,
                       const Eigenmodes& modes, const std::string& stem);

}  // namespace diracstep
