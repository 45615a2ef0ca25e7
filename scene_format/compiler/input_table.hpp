#pragma once

#include <diracstep/scene_format/compiler/lookup_table.hpp>
#include <diracstep/scene_format/compiler/scene_document.hpp>
#include <diracstep/scene_format/compiler/table_reader.hpp>
#include <optional>
#include <vector>

namespace diracstep::scene_compiler {

/// The polynomials of a table: straight lines, values that hold until the next time, or the natural cubic
/// spline, whose second derivative is continuous and vanishes at both ends.
LookupTable table_of(const SceneDocument::Input& input);

/// [control] of a scene file; none where it has none.  Throws SceneError: names that are no single parameters
/// of the file, no cost.
std::optional<SceneDocument::Control> read_control(const TableReader& tables, const toml::table& root,
                                                   const std::vector<SceneDocument::Parameter>& parameters);

}  // namespace diracstep::scene_compiler
