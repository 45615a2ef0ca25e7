#pragma once

#include <diracstep/command/session.hpp>
#include <string>
#include <vector>

namespace diracstep::command {

/// The scenes that a word means: a name or the path of a .toml file; a pattern with * and ?, such as
/// "kepler*"; or a class such as "holonomic", which takes the catalogue's scenes of that class. Throws Misuse
/// where nothing fits.
std::vector<CatalogueScene> scenes_meant(const Session& session, const std::string& word,
                                         const Parameters& changes);

}  // namespace diracstep::command
