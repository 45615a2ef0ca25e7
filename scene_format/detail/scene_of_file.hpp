#pragma once

#include <diracstep/core/system/scene.hpp>
#include <diracstep/scene_format/loader/loaded_scene.hpp>

namespace diracstep {

/// The scene that a loaded file describes, with all its rows, from this start.
Scene scene_of(const LoadedScenePtr& loaded, const Start& start);

}  // namespace diracstep
