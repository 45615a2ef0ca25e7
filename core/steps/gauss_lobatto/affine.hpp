#pragma once

#include <algorithm>
#include <diracstep/core/system/scene.hpp>

namespace diracstep {

/// Whether the residual of a step is affine in the unknowns: a quadratic L, no force, constant rows.
inline bool affine(const Scene& scene) {
  const auto constant = [](const auto& block) { return block->constant(); };
  return scene.lagrangian->structure().quadratic && !scene.force &&
         std::ranges::all_of(scene.constraints, constant);
}

}  // namespace diracstep
