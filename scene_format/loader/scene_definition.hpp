#pragma once

#include <diracstep/scene_format/compiler/scene_document.hpp>
#include <string>
#include <utility>
#include <vector>

namespace diracstep {

/// All of a scene file that its motion depends on, entry by entry: {"lagrangian", "m*v_x^2/2"}, {"force on
/// x", …}, {"row top", …}, {"parameter tab", "1, 2"}, {"definition r", …}, {"start of v_x", …}.  Formulas
/// stand without spaces, as the file has them, values of --set are not in them; a long entry is given by its
/// length and its SHA-256.  Two files with the same entries have the same motions for the same parameters.
std::vector<std::pair<std::string, std::string>> scene_definition(
    const scene_compiler::SceneDocument& document);

}  // namespace diracstep
