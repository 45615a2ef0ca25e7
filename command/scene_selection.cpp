#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <diracstep/command/scene_selection.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/scene_file.hpp>

namespace diracstep::command {

namespace {

/// "large, holonomic" is of the classes "large" and "holonomic".
bool of_class(const std::string& kind, const std::string& wanted) {
  return (", " + kind + ",").find(", " + wanted + ",") != std::string::npos;
}

std::vector<CatalogueScene> of_pattern(const Session& session, const std::string& pattern,
                                       const Parameters& changes) {
  std::vector<CatalogueScene> scenes;
  for (const std::string& name : scene_names(session))
    if (fnmatch(pattern.c_str(), name.c_str(), 0) == 0) scenes.push_back(make_scene(session, name, changes));
  if (scenes.empty())
    throw Misuse(
        fmt::format("no scene is like '{}'; known ones: {}", pattern, fmt::join(scene_names(session), ", ")));
  return scenes;
}

}  // namespace

std::vector<CatalogueScene> scenes_meant(const Session& session, const std::string& word,
                                         const Parameters& changes) {
  const auto known = scene_names(session);
  if (std::ranges::find(known, word) != known.end() || is_scene_file(word))
    return {make_scene(session, word, changes)};
  if (word.find_first_of("*?") != std::string::npos) return of_pattern(session, word, changes);
  std::vector<CatalogueScene> scenes;
  for (const std::string& name : known)
    if (CatalogueScene entry = make_scene(session, name); of_class(entry.kind, word))
      scenes.push_back(changes.empty() ? std::move(entry) : make_scene(session, name, changes));
  if (scenes.empty()) scenes.push_back(make_scene(session, word, changes));  // which says what is wrong
  return scenes;
}

}  // namespace diracstep::command
