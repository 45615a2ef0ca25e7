#pragma once

#include <diracstep/scene_format/compiler/evaluator.hpp>
#include <diracstep/scene_format/compiler/scene_document.hpp>
#include <map>
#include <string>

namespace diracstep {

/// The parameter or size of this name; null where there is none, and for an array.
const scene_compiler::SceneDocument::Parameter* find_parameter(const scene_compiler::SceneDocument& document,
                                                               const std::string& name);

/// The values of the file with these changes, by "m" or, for an element of an array, "m[2]".  Throws Misuse
/// for an unknown name and for a value that is not allowed.
scene_compiler::ParameterValues parameter_values(const scene_compiler::SceneDocument& document,
                                                 const std::map<std::string, double>& changes);

}  // namespace diracstep
