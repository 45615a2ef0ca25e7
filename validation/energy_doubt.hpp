#pragma once

#include <diracstep/core/integrator.hpp>
#include <string>

namespace diracstep {

/// Whether the energy is a constant of the scene's motion: no force, no time in L, no driven rows (as far as
/// the start shows).  Needs a scene with a Lagrangian, see completed().
bool keeps_energy(const Scene& scene);

/// Empty, or a line that says why the end of a run is not to be believed: the scene keeps its energy, and the
/// run has changed it by more than a tenth of the energies at play,
///
///   max(|E(start)|, min |p·v|/2, min |q|∞ |∂L/∂q|∞),   the smaller value at the start and at the end.
///
/// No method here changes the energy so much at a step that resolves the motion.  Silence proves nothing: an
/// energy can be kept on a wrong path, and is not looked at in between.
std::string energy_doubt(const Scene& scene, const Sample& end);

}  // namespace diracstep
