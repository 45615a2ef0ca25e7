#pragma once

#include <diracstep/scene_format/loader/loaded_scene.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <vector>

namespace diracstep {

/// The bodies of a scene with the sizes they have for its parameters.
std::vector<DrawnBody> drawn_bodies(const LoadedScene& loaded);

}  // namespace diracstep
