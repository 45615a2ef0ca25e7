#pragma once

#include <diracstep/scene_format/compiler/scene_document.hpp>
#include <string>

namespace diracstep::scene_compiler {

/// A circuit from a netlist in the language of SPICE (docs/circuits.md has the subset): R, L, C, V, I, D, K,
/// E, F, G, H, `.model` of diodes, `.param`, `.tran`, `.print`.  Names of elements in capitals and those of
/// nodes and parameters in small letters are those of the scene; the current I(V1) flows through the source
/// from its first node to its second.  Throws SceneError with the line for all that is not in the subset.
SceneDocument read_netlist(const std::string& file, const std::string& text);

}  // namespace diracstep::scene_compiler
