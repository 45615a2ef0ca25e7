#pragma once

#include <diracstep/scene_format/scene_catalogue.hpp>
#include <string>
#include <string_view>

namespace diracstep {

/// Whether a name is the path of a file: a scene file NAME.toml or a netlist NAME.cir.
inline bool is_scene_file(std::string_view name) { return name.ends_with(".toml") || name.ends_with(".cir"); }

/// A scene from the text of a scene file (docs/scene_format.md), or of a netlist (docs/circuits.md) where
/// `file`, which names it in messages, ends with .cir.
CatalogueScene scene_from_text(const std::string& file, const std::string& text,
                               const Parameters& changes = {});

/// A scene from a file.  Throws Misuse where it cannot be read.
CatalogueScene scene_from_file(const std::string& path, const Parameters& changes = {});

}  // namespace diracstep
