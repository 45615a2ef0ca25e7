#pragma once

#include <string>

namespace diracstep::scene_compiler {

/// A scene file with bodies (docs/bodies.md) as one without: what they make stands behind the file's own
/// coordinates, definitions, rows, forces, starts and outputs.  It loads and runs to the same bits.  The text
/// as it is where there are none.  Throws SceneError for what is wrong in the file, and for a netlist.
std::string plain_scene(const std::string& file, const std::string& text);

}  // namespace diracstep::scene_compiler
