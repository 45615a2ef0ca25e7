#pragma once

#include <string>

namespace diracstep {

/// The text of a scene's file, by its name in the catalogue or by its path.  Throws Misuse as make_scene
/// does.
std::string scene_text(const std::string& name);

}  // namespace diracstep
