#pragma once

#include <diracstep/core/system/scene.hpp>
#include <string>

namespace diracstep {

/// Two scenes and rows between them as one:  (L1 + L2, (Δ1 ⊕ Δ2) ∩ Δ_int)  with both forces and starts.
///
/// The coordinates and rows of a scene come with its name in front, "left.x"; those of the second stand
/// behind those of the first, and `interaction` counts them so.  Patterns stay sparse: nothing couples the
/// scenes but the interaction.  The Hamiltonian of the whole is the sum where both have one.  Throws Misuse
/// where the names or the times of the starts do not differ or agree as they must, or a size is wrong.
Scene interconnection(const std::string& name, const Scene& first, const Scene& second,
                      const ConstraintBlocks& interaction);

}  // namespace diracstep
