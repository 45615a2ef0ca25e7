#include <algorithm>
#include <diracstep/core/numerics/names.hpp>
#include <numeric>

namespace diracstep {

namespace {

constexpr std::size_t longest = 64;  // a longer name is near to nothing

/// Optimal string alignment: insertions, deletions, replacements, and neighbours that changed places.
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before, last(b.size() + 1), row(b.size() + 1);
  std::iota(last.begin(), last.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before[j - 2] + 1);
    }
    before = last;
    last = row;
  }
  return last[b.size()];
}

}  // namespace

std::string near_name(std::string_view given, const std::vector<std::string>& known) {
  if (known.empty() || given.empty()) return {};
  const std::string_view name = given.substr(0, longest);
  const auto nearest = std::ranges::min_element(
      known, {}, [&](const std::string& candidate) { return distance(name, candidate); });
  // One letter is no misspelling of another.
  const std::size_t allowed = given.size() == 1 ? 0 : std::max<std::size_t>(1, given.size() / 3);
  if (distance(name, *nearest) <= allowed) return *nearest;
  const auto begun = [&](const std::string& candidate) { return candidate.starts_with(name); };
  return std::ranges::count_if(known, begun) == 1 ? *std::ranges::find_if(known, begun) : "";
}

std::string did_you_mean(std::string_view name, const std::vector<std::string>& known) {
  const std::string near = near_name(name, known);
  return near.empty() ? "" : " (did you mean '" + near + "'?)";
}

std::string name_list(const std::vector<std::string>& names, std::size_t most, std::string_view quote) {
  std::string list;
  for (std::size_t i = 0; i < std::min(most, names.size()); ++i)
    (list += i > 0 ? ", " : "").append(quote).append(names[i]).append(quote);
  if (names.size() > most) list += " and " + std::to_string(names.size() - most) + " more";
  return list;
}

}  // namespace diracstep
