#include <algorithm>
#include <diracstep/core/numerics/names.hpp>
#include <diracstep/files/shown_text.hpp>
#include <diracstep/scene_format/compiler/scene_error.hpp>

namespace diracstep::scene_compiler {

namespace {

constexpr std::size_t longest_list = 24;  // names in a message

std::string with_place(const std::string& file, Place place, const std::string& message) {
  std::string text = file;
  if (place.line > 0) text += ':' + std::to_string(place.line);
  if (place.column > 0) text += ':' + std::to_string(place.column);
  return text + ": " + message;
}

}  // namespace

SceneError::SceneError(const std::string& file, Place place, const std::string& message)
    : Misuse(shown_line(with_place(file, place, message))) {}

std::string suggestion(std::string_view name, const std::vector<std::string>& known) {
  if (known.empty()) return "";
  if (const std::string near = near_name(name, known); !near.empty()) return "; did you mean '" + near + "'?";
  std::string list = "; known are";
  for (std::size_t i = 0; i < std::min(known.size(), longest_list); ++i) list += ' ' + known[i];
  return known.size() > longest_list ? list + " …" : list;
}

}  // namespace diracstep::scene_compiler
