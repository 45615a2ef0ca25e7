#pragma once

#include <diracstep/core/system/first_order_motions.hpp>
#include <vector>

namespace diracstep {

/// The start moved onto φ = 0, the hidden equations and A v + b = 0, by Newton's method with the least
/// changes of those q and v_i that `may_move` tells (2n entries, q first).  Throws Misuse where that fails.
Start moved_onto_hidden(const Scene& scene, const FirstOrderMotions& motions, Start start,
                        const std::vector<bool>& may_move);

}  // namespace diracstep
