#pragma once

#include <diracstep/scene_format/compiler/scene_document.hpp>

namespace diracstep::scene_compiler {

/// Notes what the laws of a circuit leave open, as far as its elements tell: nodes that nothing joins to node
/// 0, and those that only capacitors and current sources do, which have no path for a direct current.
void note_floating_nodes(SceneDocument& document);

}  // namespace diracstep::scene_compiler
