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

}  // namespace diracstep
