#include <fmt/format.h>

#include <algorithm>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/end_conditions.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/near_names.hpp>

namespace diracstep::command {

namespace {

/// What is asked of one end, by columns of (q, v, p).
using Asked = std::vector<std::pair<Eigen::Index, double>>;

Asked asked(const Scene& scene, const std::vector<std::string>& assignments, const std::string& option) {
  const std::vector<std::string> known = names_at_an_end(scene);
  Asked result;
  for (const auto& [name, value] : parameters(assignments, option)) {
    const auto found = std::ranges::find(known, name);
    if (found == known.end())
      throw Misuse(fmt::format("{}: '{}' is no coordinate of scene '{}', nor v_ or p_ before one{}", option,
                               name, scene.name, did_you_mean(name, known)));
    result.emplace_back(found - known.begin(), value);
  }
  std::ranges::sort(result);  // places first
  return result;
}

bool holds_all_places(const Asked& at, int n) {
  return std::ranges::count_if(at, [n](const auto& one) { return one.first < n; }) == n;
}

/// Conditions in the order of BoundaryConditions: where all of a place is given, q0 first and qN last.
BoundaryConditions conditions_of(const Asked& start, const Asked& end, int n) {
  const auto rows = static_cast<Eigen::Index>(start.size() + end.size());
  BoundaryConditions conditions{Columns::Zero(rows, 3 * n), Columns::Zero(rows, 3 * n), Vector(rows),
                                holds_all_places(start, n), holds_all_places(end, n),   false};
  Eigen::Index row = 0;
  for (const auto& [column, value] : start) {
    conditions.at_start(row, column) = 1.0;
    conditions.value[row++] = value;
  }
  const auto places = std::ranges::partition_point(end, [n](const auto& one) { return one.first < n; });
  const auto put = [&](const auto& one) {
    conditions.at_end(row, one.first) = 1.0;
    conditions.value[row++] = one.second;
  };
  std::for_each(places, end.end(), put);
  std::for_each(end.begin(), places, put);
  return conditions;
}

}  // namespace

std::vector<std::string> names_at_an_end(const Scene& scene) {
  std::vector<std::string> known;
  for (const char* prefix : {"", "v_", "p_"})
    for (const std::string& name : scene.coordinates) known.push_back(prefix + name);
  return known;
}

BoundaryConditions conditions_at_ends(const Scene& scene, const std::vector<std::string>& from,
                                      const std::vector<std::string>& to) {
  const int n = scene.dimension();
  Asked start = asked(scene, from, "--from");
  if (from.empty())
    for (int i = 0; i < n; ++i) start.emplace_back(i, scene.start.q[i]);
  return conditions_of(start, asked(scene, to, "--to"), n);
}

BoundaryConditions conditions_from_start(const Scene& scene, const std::vector<std::string>& to) {
  const int n = scene.dimension();
  Asked start;
  for (int i = 0; i < n; ++i) start.emplace_back(i, scene.start.q[i]);
  for (int i = 0; i < n; ++i) start.emplace_back(n + i, scene.start.v[i]);
  return conditions_of(start, asked(scene, to, "--to"), n);
}

}  // namespace diracstep::command
