#pragma once

#include <string>

namespace diracstep {

/// The text of a small scene that runs as it is, with comments that say what may be written where.  Throws
/// Misuse for a name that a scene cannot have.
std::string scene_template(const std::string& name);

}  // namespace diracstep
