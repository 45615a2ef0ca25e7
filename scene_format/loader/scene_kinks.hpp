#pragma once

#include <diracstep/core/system/kinks.hpp>
#include <diracstep/scene_format/loader/loaded_scene.hpp>
#include <memory>

namespace diracstep {

/// Where the formulas of a loaded scene are not smooth or change fast; null where they are smooth and nothing
/// in them depends on the time.
std::shared_ptr<const Kinks> file_kinks(const LoadedScenePtr& scene);

}  // namespace diracstep
