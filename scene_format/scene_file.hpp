#pragma once

#include <diracstep/scene_format/scene_catalogue.hpp>
#include <memory>
#include <string>
#include <string_view>

namespace diracstep {

/// Whether a name is the path of a file: a scene file NAME.toml or a netlist NAME.cir.
inline bool is_scene_file(std::string_view name) { return name.ends_with(".toml") || name.ends_with(".cir"); }

/// A scene file, compiled once, for scenes with many values of its parameters.  May be copied, and used from
/// several threads at once.
class SceneFile {
 public:
  /// As scene_from_text; throws Misuse for what is wrong in the text.
  SceneFile(std::string file, std::string text);
  CatalogueScene load(const Parameters& changes = {}) const;

 private:
  struct Compiled;
  std::shared_ptr<Compiled> compiled_;
};

/// A scene from the text of a scene file (docs/scene_format.md), or of a netlist (docs/circuits.md) where
/// `file`, which names it in messages, ends with .cir.
CatalogueScene scene_from_text(const std::string& file, const std::string& text,
                               const Parameters& changes = {});

/// The same for a name of the catalogue or the path of a file.  Throws Misuse as make_scene does.
SceneFile scene_source(const std::string& name);

/// The text of a scene without its bodies, joints and contacts: what they make as coordinates, a Lagrangian
/// and rows (docs/bodies.md).  It runs to the same bits.  Throws Misuse as scene_source does.
std::string expanded_scene(const std::string& name);

/// A scene from a file.  Throws Misuse where it cannot be read.
CatalogueScene scene_from_file(const std::string& path, const Parameters& changes = {});

}  // namespace diracstep
