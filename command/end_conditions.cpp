#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/end_conditions.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/near_names.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/files/csv_table.hpp>

namespace diracstep::command {

namespace {

constexpr std::size_t most_guess_bytes = 100'000'000;

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

GuessedMotion through_points(const Vector& times, const Columns& q, const Columns& v) {
  return [=](double t) {
    const Eigen::Index last = times.size() - 1;
    if (last == 0) return GuessedPoint{q.col(0), v.col(0)};
    const double sign = times[last] > times[0] ? 1.0 : -1.0;
    Eigen::Index k = 0;
    while (k < last - 1 && sign * (times[k + 1] - t) < 0.0) ++k;
    const double part = std::clamp((t - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0);
    return GuessedPoint{q.col(k) + part * (q.col(k + 1) - q.col(k)),
                        v.col(k) + part * (v.col(k + 1) - v.col(k))};
  };
}

GuessedMotion guess_from_file(const std::string& path, const Scene& scene) {
  const CsvTable table = read_csv(path, "--guess", most_guess_bytes, 2, EmptyFields::missing);
  if (table.lines.empty()) throw Misuse(fmt::format("--guess: '{}' has no lines of data", path));
  const int n = scene.dimension();
  const auto count = static_cast<Eigen::Index>(table.lines.size());
  Vector times(count);
  Columns states = Columns::Zero(2 * n, count);
  const std::vector<std::string> known = names_at_an_end(scene);
  const auto read = [&](const std::string& name, const auto& put) {
    const auto found = std::ranges::find(table.names, name);
    if (found == table.names.end()) return false;
    for (Eigen::Index k = 0; k < count; ++k) {
      const double number =
          table.lines[static_cast<std::size_t>(k)][static_cast<std::size_t>(found - table.names.begin())];
      if (!std::isfinite(number))
        throw Misuse(fmt::format("--guess: '{}': a field of the column '{}' is empty", path, name));
      put(k, number);
    }
    return true;
  };
  if (!read("t", [&](Eigen::Index k, double t) { times[k] = t; }))
    throw Misuse(fmt::format("--guess: '{}' has no column t", path));
  for (Eigen::Index k = 1; k < count; ++k)
    if (!((times[k] - times[k - 1]) * (times[count - 1] - times[0]) > 0.0))
      throw Misuse(fmt::format("--guess: '{}': t = {:g} does not follow {:g}", path, times[k], times[k - 1]));
  for (int i = 0; i < 2 * n; ++i) {
    const std::string& name = known[static_cast<std::size_t>(i)];
    if (!read(name, [&](Eigen::Index k, double value) { states(i, k) = value; }))
      throw Misuse(fmt::format("--guess: '{}' has no column '{}'", path, name));
  }
  return through_points(times, states.topRows(n), states.bottomRows(n));
}

GuessedMotion guess_from_start(const std::shared_ptr<const Scene>& scene, const Session& session,
                               const IntegratorOptions& options, long steps) {
  Integrator integrator(scene, session.registry, session.solvers, options);
  const int n = scene->dimension();
  Vector times(steps + 1);
  Columns q(n, steps + 1), v(n, steps + 1);
  Eigen::Index k = 0;
  const RunReport run = run_steps(integrator, steps, Momentum::projected, 1, [&](const Sample& sample) {
    times[k] = sample.time;
    q.col(k) = sample.q;
    v.col(k) = sample.v.size() > 0 ? sample.v : Vector::Zero(n);
    return ++k <= steps;
  });
  if (k <= steps)
    throw Error(
        fmt::format("the motion from the start, which is the guess, fails: {}; --guess FILE gives another",
                    run.last.failure));
  return through_points(times, q, v);
}

}  // namespace diracstep::command
