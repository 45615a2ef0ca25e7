#pragma once

#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/sensitivities/parametric_scene.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// A scene that make_scene() has made from this name and these changes, to be differentiated by some of its
/// parameters: their derivatives come from the formulas of the file, those of the start included, also where
/// it was moved onto the rows.  Throws Misuse for a name that is no parameter, for a size or an array, and
/// for a scene that is not from a file.
ParametricScene parametric_scene(const std::string& name, const CatalogueScene& entry,
                                 const std::vector<std::string>& parameters, const Parameters& changes = {});

/// The same of the text of a scene file, as scene_from_text() takes it.
ParametricScene parametric_scene_from_text(const std::string& file, const std::string& text,
                                           const CatalogueScene& entry,
                                           const std::vector<std::string>& parameters,
                                           const Parameters& changes = {});

/// [control] of a scene file: parameters u that are chosen at each time, and what they cost.
struct SceneControl {
  std::vector<std::string> names;
  std::shared_ptr<const Force> force;  ///< all of the force by (q, u), as ParametricScene::extended has it
  std::shared_ptr<const Lagrangian> cost, end_cost;  ///< of (q, u), (v, 0); null where there is none
  Vector values, lower, upper;  ///< of u: as the file has it, and its limits, infinite where there are none
  std::shared_ptr<const Kinks> kinks = {};  ///< of the scene and of the cost, with u as the file has it
};

/// Of a scene that make_scene() has made from this name and these changes.  Throws Misuse for a file without
/// [control], and where u stands in the Lagrangian or in a row, or in no force.
SceneControl scene_control(const std::string& name, const CatalogueScene& entry,
                           const Parameters& changes = {});
SceneControl scene_control_from_text(const std::string& file, const std::string& text,
                                     const CatalogueScene& entry, const Parameters& changes = {});

}  // namespace diracstep
