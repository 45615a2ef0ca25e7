#pragma once

#include <diracstep/scene_format/scene_catalogue.hpp>
#include <string>

namespace diracstep {

/// A scene from the text of a scene file (docs/scene_format.md); `file` names it in messages.
CatalogueScene scene_from_text(const std::string& file, const std::string& text,
                               const Parameters& changes = {});

/// A scene from a file.  Throws Misuse where it cannot be read.
CatalogueScene scene_from_file(const std::string& path, const Parameters& changes = {});

}  // namespace diracstep
