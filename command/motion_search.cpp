#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/end_conditions.hpp>
#include <diracstep/command/motion_search.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/csv_table.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/position_names.hpp>

namespace diracstep::command {

namespace {

constexpr std::size_t most_guess_bytes = 100'000'000;

/// Through the points of a CSV file with columns t, coordinates and v_NAME.  Throws Misuse where one is
/// missing.
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

}  // namespace

void add_search_options(CLI::App& verb, Session& session, MotionSearchArguments& arguments) {
  add_solver_options(verb, session);
  add_redundancy_option(verb, session);
  add_method_options(verb, arguments.method);
  verb.add_option("--end", arguments.end, "Time of the end; the scene's own without it");
  verb.add_option("--step", arguments.step, "Step size; the scene's own without it");
  add_set_option(verb, arguments.set);
  verb.add_flag("--json", arguments.json, "One JSON document on standard output");
}

CatalogueScene searched_scene(MotionSearchArguments& arguments, Session& session, const std::string& verb) {
  CatalogueScene entry = make_scene(session, arguments.scene, parameters(arguments.set));
  require_flat(*entry.scene, verb);
  if (!entry.events.empty())
    throw Misuse(verb + " does not go with the events of the scene: when one is met is not known before");
  take_recommendation(entry, arguments.method, arguments.step);
  return entry;
}

StepGrid searched_steps(const MotionSearchArguments& arguments, const CatalogueScene& entry,
                        long most_steps) {
  const StepGrid grid = fit_steps(entry.scene->start.time, arguments.end.value_or(entry.t_end),
                                  arguments.step.value_or(entry.natural_step));
  if (grid.steps > most_steps) throw Misuse(fmt::format("{} steps; {} are the most", grid.steps, most_steps));
  return grid;
}

GuessedMotion guess_of(const MotionSearchArguments& arguments, const std::shared_ptr<const Scene>& scene,
                       const Session& session, const IntegratorOptions& options, long steps,
                       const BoundaryConditions& conditions) {
  if (!arguments.guess.empty()) return guess_from_file(arguments.guess, *scene);
  if (!conditions.start_held || !conditions.end_held) return guess_from_start(scene, session, options, steps);
  const int n = scene->dimension();
  const double t0 = scene->start.time;
  // Places at the end are the last conditions.
  return straight_line(t0, conditions.value.head(n), t0 + static_cast<double>(steps) * options.step,
                       conditions.value.tail(n));
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

std::string first_line(const Scene& scene, const Vector& times, long steps, const std::string& method,
                       int iterations) {
  return fmt::format("{} from t = {:g} to {:g}: {} steps with {}, {} iterations", scene.name, times[0],
                     times[times.size() - 1], steps, method, iterations);
}

void write_motion(const std::string& path, const Scene& scene, const FoundMotion& motion,
                  const std::vector<std::string>& further,
                  const std::function<Vector(Eigen::Index k)>& values) {
  std::string text = "t";
  for (const std::string& name : names_at_an_end(scene)) text += "," + csv_field(name);
  for (const std::string& name : further) text += "," + csv_field(name);
  text += '\n';
  for (Eigen::Index k = 0; k < motion.times.size(); ++k) {
    text += fmt::format("{:.17g}", motion.times[k]);
    for (const Columns* of : {&motion.q, &motion.v, &motion.p})
      for (const double value : of->col(k)) text += fmt::format(",{:.17g}", value);
    if (values)
      for (const double value : values(k)) text += fmt::format(",{:.17g}", value);
    text += '\n';
  }
  OutputFile file(path, OutputFile::Mode::fresh);
  file.write(text);
  file.close();
}

}  // namespace diracstep::command
