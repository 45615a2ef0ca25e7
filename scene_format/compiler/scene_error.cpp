#include <algorithm>
#include <diracstep/files/shown_text.hpp>
#include <diracstep/scene_format/compiler/scene_error.hpp>
#include <numeric>

namespace diracstep::scene_compiler {

namespace {

constexpr std::size_t longest_list = 24;  // names in a message

std::string with_place(const std::string& file, Place place, const std::string& message) {
  std::string text = file;
  if (place.line > 0) text += ':' + std::to_string(place.line);
  if (place.column > 0) text += ':' + std::to_string(place.column);
  return text + ": " + message;
}

/// Levenshtein's distance.
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

}  // namespace

SceneError::SceneError(const std::string& file, Place place, const std::string& message)
    : Misuse(shown_line(with_place(file, place, message))) {}

std::string suggestion(std::string_view name, const std::vector<std::string>& known) {
  if (known.empty()) return "";
  const std::string_view start = name.substr(0, 64);  // a longer name is near to nothing
  const auto nearest = std::ranges::min_element(
      known, {}, [&](const std::string& candidate) { return distance(start, candidate); });
  if (distance(start, *nearest) <= std::max<std::size_t>(1, name.size() / 3))
    return "; did you mean '" + *nearest + "'?";
  std::string list = "; known are";
  for (std::size_t i = 0; i < std::min(known.size(), longest_list); ++i) list += ' ' + known[i];
  return known.size() > longest_list ? list + " …" : list;
}

}  // namespace diracstep::scene_compiler
