#include <algorithm>
#include <cmath>
#include <diracstep/boundary_values/named_ends.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/names.hpp>
#include <limits>
#include <utility>

namespace diracstep {

namespace {

/// What is asked of one end, by columns of (q, v, p).
using Asked = std::vector<std::pair<Eigen::Index, double>>;

Asked asked(const Scene& scene, const NamedNumbers& numbers, const std::string& which) {
  const std::vector<std::string> known = names_at_an_end(scene);
  Asked result;
  for (const auto& [name, value] : numbers) {
    const auto found = std::ranges::find(known, name);
    if (found == known.end())
      throw Misuse("asked of the " + which + ": '" + name + "' is no coordinate of scene '" + scene.name +
                   "', nor v_ or p_ before one" + did_you_mean(name, known));
    if (!std::isfinite(value))
      throw Misuse("asked of the " + which + ": " + name + " is " + to_text(value) +
                   "; a finite number is needed");
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
  BoundaryConditions conditions{Columns::Zero(rows, 3L * n), Columns::Zero(rows, 3L * n), Vector(rows),
                                holds_all_places(start, n),  holds_all_places(end, n),    false};
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

void set_bounds_of_one_side(ControlProblem& problem, const NamedNumbers& bounds, bool lower) {
  const Scene& scene = *problem.controlled.scene;
  const std::vector<std::string>& controls = problem.controlled.controls;
  std::vector<std::string> known = scene.coordinates;
  known.insert(known.end(), controls.begin(), controls.end());
  const auto n = static_cast<std::size_t>(scene.dimension());
  for (const auto& [name, value] : bounds) {
    const auto found = std::ranges::find(known, name);
    if (found == known.end())
      throw Misuse("a bound: '" + name + "' is neither a coordinate nor a control of scene '" + scene.name +
                   "'" + did_you_mean(name, known));
    if (std::isnan(value)) throw Misuse("a bound: that of " + name + " is no number");
    const auto place = static_cast<std::size_t>(found - known.begin());
    Vector& of = place < n ? (lower ? problem.lower_q : problem.upper_q)
                           : (lower ? problem.controlled.lower : problem.controlled.upper);
    of[static_cast<Eigen::Index>(place < n ? place : place - n)] = value;
  }
}

}  // namespace

std::vector<std::string> names_at_an_end(const Scene& scene) {
  std::vector<std::string> known;
  for (const char* prefix : {"", "v_", "p_"})
    for (const std::string& name : scene.coordinates) known.push_back(prefix + name);
  return known;
}

BoundaryConditions conditions_at_ends(const Scene& scene, const NamedNumbers& start,
                                      const NamedNumbers& end) {
  const int n = scene.dimension();
  Asked at_start = asked(scene, start, "start");
  if (start.empty())
    for (int i = 0; i < n; ++i) at_start.emplace_back(i, scene.start.q[i]);
  return conditions_of(at_start, asked(scene, end, "end"), n);
}

BoundaryConditions conditions_from_start(const Scene& scene, const NamedNumbers& end) {
  const int n = scene.dimension();
  Asked start;
  for (int i = 0; i < n; ++i) start.emplace_back(i, scene.start.q[i]);
  for (int i = 0; i < n; ++i) start.emplace_back(n + i, scene.start.v[i]);
  return conditions_of(start, asked(scene, end, "end"), n);
}

void set_bounds(ControlProblem& problem, const NamedNumbers& least, const NamedNumbers& greatest) {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  const auto open = [&](Vector& bounds, Eigen::Index size, double none) {
    if (bounds.size() == 0) bounds = Vector::Constant(size, none);
  };
  const auto controls = static_cast<Eigen::Index>(problem.controlled.controls.size());
  open(problem.lower_q, problem.controlled.scene->dimension(), -infinite);
  open(problem.upper_q, problem.controlled.scene->dimension(), infinite);
  open(problem.controlled.lower, controls, -infinite);
  open(problem.controlled.upper, controls, infinite);
  set_bounds_of_one_side(problem, least, true);
  set_bounds_of_one_side(problem, greatest, false);
}

}  // namespace diracstep
