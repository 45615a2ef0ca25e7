#pragma once

#include <diracstep/core/system/scene.hpp>
#include <diracstep/scene_format/loader/loaded_scene.hpp>

namespace diracstep {

/// Throws SceneError where a formula cannot be computed at the start, telling the operation and its place: a
/// division by zero, the logarithm of a negative number.
void require_defined(const LoadedScene& scene, const Scene& functions, double t, ConstVectorRef q,
                     ConstVectorRef v, ConstVectorRef p);

}  // namespace diracstep
