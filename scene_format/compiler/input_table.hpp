#pragma once

#include <diracstep/scene_format/compiler/lookup_table.hpp>
#include <diracstep/scene_format/compiler/scene_document.hpp>

namespace diracstep::scene_compiler {

/// The polynomials of a table: straight lines, values that hold until the next time, or the natural cubic
/// spline, whose second derivative is continuous and vanishes at both ends.
LookupTable table_of(const SceneDocument::Input& input);

}  // namespace diracstep::scene_compiler
