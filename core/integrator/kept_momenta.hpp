#pragma once

#include <diracstep/core/system/scene.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// Names of the coordinates along which neither L (or H) changes nor a force or a row acts, so that by
/// d'Alembert's principle, d/dt ⟨p, η⟩ = ⟨∂L/∂q + f + AᵀΛ, η⟩, the momentum along them is kept: cyclic
/// coordinates, and for a rotation R_3 the momentum about the third axis of space, ⟨p, Ad_{g⁻¹} e_3⟩
/// (Noether).
///
/// Found by derivatives at a few points near the start that are nowhere special: in R^n they have to be zero
/// in every bit, as those of a formula without the coordinate are; on groups, where they turn with g,
/// round-off beside the others.  A symmetry along a combination of coordinates is not looked for. E. Noether
/// (1918); Marsden, West, Acta Numerica 10 (2001), 1.2.
std::vector<std::string> kept_momenta(const Scene& scene);

}  // namespace diracstep
