#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <diracstep/boundary_values/boundary_values.hpp>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/files/data_table.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/near_names.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <memory>
#include <optional>

namespace diracstep::command {

namespace {

struct BoundaryArguments {
  std::string scene, guess, out;
  std::vector<std::string> from, to, set;
  bool periodic = false, json = false;
  MethodChoice method;
  std::optional<double> end, step;
};

constexpr int most_conditions_shown = 40;  // coordinates, multipliers
constexpr long most_boundary_steps = 10'000'000;

/// Columns of q, v and p as conditions name them: x, v_x, p_x.
std::vector<std::string> names_at_an_end(const Scene& scene) {
  std::vector<std::string> known;
  for (const char* prefix : {"", "v_", "p_"})
    for (const std::string& name : scene.coordinates) known.push_back(prefix + name);
  return known;
}

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

/// Between the points of a table, straight.
GuessedMotion through(Vector times, Columns q, Columns v) {
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
  const DataTable table = read_table(path);
  const int n = scene.dimension();
  const auto count = static_cast<Eigen::Index>(table.rows.size());
  Vector times(count);
  Columns states = Columns::Zero(2 * n, count);
  const std::vector<std::string> known = names_at_an_end(scene);
  const auto read = [&](const std::string& name, const auto& put) {
    const auto found = std::ranges::find(table.names, name);
    if (found == table.names.end()) return false;
    for (Eigen::Index k = 0; k < count; ++k) {
      const double number =
          table.rows[static_cast<std::size_t>(k)][static_cast<std::size_t>(found - table.names.begin())];
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
  return through(times, states.topRows(n), states.bottomRows(n));
}

/// The motion from the start of the scene.
GuessedMotion guess_from_start(const BoundaryProblem& problem) {
  Integrator integrator(problem.scene, problem.registry, problem.solvers, problem.options);
  const int n = problem.scene->dimension();
  Vector times(problem.steps + 1);
  Columns q(n, problem.steps + 1), v(n, problem.steps + 1);
  Eigen::Index k = 0;
  const RunReport run =
      run_steps(integrator, problem.steps, Momentum::projected, 1, [&](const Sample& sample) {
        times[k] = sample.time;
        q.col(k) = sample.q;
        v.col(k) = sample.v.size() > 0 ? sample.v : Vector::Zero(n);
        return ++k <= problem.steps;
      });
  if (k <= problem.steps)
    throw Error(
        fmt::format("the motion from the start, which is the guess, fails: {}; --guess FILE gives another",
                    run.last.failure));
  return through(times, q, v);
}

GuessedMotion guess_of(const BoundaryArguments& arguments, const BoundaryProblem& problem) {
  if (!arguments.guess.empty()) return guess_from_file(arguments.guess, *problem.scene);
  const BoundaryConditions& conditions = problem.conditions;
  if (!conditions.start_held || !conditions.end_held) return guess_from_start(problem);
  const int n = problem.scene->dimension();
  const double t0 = problem.scene->start.time;
  return straight_line(t0, conditions.value.head(n),
                       t0 + static_cast<double>(problem.steps) * problem.options.step,
                       conditions.value.tail(n));
}

std::string multiplier_text(std::complex<double> value) {
  if (value.imag() == 0.0) return fmt::format("{:.10g}", value.real());
  return fmt::format("{:.10g} {} {:.10g} i, size {:.10g}", value.real(), value.imag() < 0.0 ? '-' : '+',
                     std::abs(value.imag()), std::abs(value));
}

std::string boundary_text(const BoundaryReport& report, const BoundaryProblem& problem,
                          const std::string& method) {
  const Scene& scene = *problem.scene;
  const int n = scene.dimension();
  const Eigen::Index last = report.times.size() - 1;
  std::string text =
      fmt::format("{} from t = {:g} to {:g}: {} steps with {}, {} iterations\n\n", scene.name,
                  report.times[0], report.times[last], problem.steps, method, report.iterations);
  std::vector<std::vector<std::string>> rows{
      {"coordinate", "q at the start", "v", "p", "q at the end", "v", "p"}};
  for (int i = 0; i < std::min(n, most_conditions_shown); ++i) {
    auto& row = rows.emplace_back(std::vector<std::string>{scene.coordinates[static_cast<std::size_t>(i)]});
    for (const Eigen::Index k : {Eigen::Index{0}, last})
      for (const Columns* of : {&report.q, &report.v, &report.p})
        row.push_back(fmt::format("{:.10g}", (*of)(i, k)));
  }
  text += aligned(rows);
  if (n > most_conditions_shown)
    text +=
        fmt::format("… {} of {} coordinates left out; --json has them all\n", n - most_conditions_shown, n);
  if (!report.converged) return text;
  text += report.action ? fmt::format("\naction: {:.15g}\n", report.action->value)
                        : fmt::format("\nno action: {}\n", report.no_action);
  if (!problem.conditions.families) return text;
  text +=
      fmt::format("directions that the conditions leave free: {}\nmultipliers:\n", report.free_directions);
  const std::size_t shown =
      std::min(report.multipliers.size(), static_cast<std::size_t>(most_conditions_shown));
  for (std::size_t k = 0; k < shown; ++k) text += "  " + multiplier_text(report.multipliers[k]) + '\n';
  return text;
}

Json end_json(const BoundaryReport& report, const Scene& scene, Eigen::Index k) {
  Json json{{"t", report.times[k]}};
  for (const auto& [name, of] : {std::pair{"q", &report.q}, {"v", &report.v}, {"p", &report.p}}) {
    json[name] = Json::object();
    for (int i = 0; i < scene.dimension(); ++i)
      add_member(json[name], scene.coordinates[static_cast<std::size_t>(i)], Json((*of)(i, k)));
  }
  return json;
}

Json list_json(const Vector& values) { return Json(std::vector<double>(values.begin(), values.end())); }

std::string boundary_json(const BoundaryReport& report, const BoundaryProblem& problem,
                          const std::string& method) {
  Json json{{"scene", problem.scene->name},
            {"converged", report.converged},
            {"ending", report.ending},
            {"doubt", report.doubt.empty() ? Json(nullptr) : Json(report.doubt)},
            {"method", method},
            {"steps", problem.steps},
            {"step", problem.options.step},
            {"iterations", report.iterations},
            {"correction", Json(report.correction)},
            {"residual", Json(report.residual)},
            {"start", end_json(report, *problem.scene, 0)},
            {"end", end_json(report, *problem.scene, report.times.size() - 1)},
            {"action", nullptr},
            {"no_action", report.no_action.empty() ? Json(nullptr) : Json(report.no_action)}};
  if (report.action) {
    json["action"] = {{"value", report.action->value}, {"gradient", list_json(report.action->gradient)}};
    Json hessian = Json::array();
    for (Eigen::Index i = 0; i < report.action->hessian.rows(); ++i)
      hessian.push_back(list_json(report.action->hessian.row(i)));
    json["action"]["hessian"] = hessian.empty() ? Json(nullptr) : hessian;
  }
  if (report.converged && problem.conditions.families) {
    json["free_directions"] = report.free_directions;
    json["multipliers"] = Json::array();
    for (const auto& value : report.multipliers) json["multipliers"].push_back({value.real(), value.imag()});
  }
  return to_text(json, 2) + '\n';
}

void write_motion(const std::string& path, const BoundaryReport& report, const Scene& scene) {
  std::string text = "t";
  for (const std::string& name : names_at_an_end(scene)) text += "," + csv_field(name);
  text += '\n';
  for (Eigen::Index k = 0; k < report.times.size(); ++k) {
    text += fmt::format("{:.17g}", report.times[k]);
    for (const Columns* of : {&report.q, &report.v, &report.p})
      for (const double value : of->col(k)) text += fmt::format(",{:.17g}", value);
    text += '\n';
  }
  OutputFile file(path, OutputFile::Mode::fresh);
  file.write(text);
  file.close();
}

BoundaryConditions conditions_of(const BoundaryArguments& arguments, const Scene& scene) {
  const int n = scene.dimension();
  if (arguments.periodic) {
    if (!arguments.from.empty() || !arguments.to.empty())
      throw Misuse("--periodic says all of both ends: it does not go with --from and --to");
    return periodic(n);
  }
  if (arguments.to.empty())
    throw Misuse("--to NAME=VALUE says what is asked of the end, or --periodic that it is as the start");
  Asked start = asked(scene, arguments.from, "--from");
  if (arguments.from.empty())
    for (int i = 0; i < n; ++i) start.emplace_back(i, scene.start.q[i]);
  return conditions_of(start, asked(scene, arguments.to, "--to"), n);
}

void run_boundary(BoundaryArguments arguments, Session& session) {
  const CatalogueScene entry = make_scene(session, arguments.scene, parameters(arguments.set));
  require_flat(*entry.scene, "boundary");
  if (!entry.events.empty())
    throw Misuse("boundary does not go with the events of the scene: when one is met is not known before");
  take_recommendation(entry, arguments.method, arguments.step);
  const double end = arguments.end.value_or(entry.t_end);
  const StepGrid grid = fit_steps(entry.scene->start.time, end, arguments.step.value_or(entry.natural_step));
  if (grid.steps > most_boundary_steps)
    throw Misuse(fmt::format("{} steps; {} are the most", grid.steps, most_boundary_steps));
  BoundaryProblem problem{entry.scene,
                          session.registry,
                          session.solvers,
                          integrator_options(session, arguments.method),
                          grid.steps,
                          conditions_of(arguments, *entry.scene),
                          {}};
  problem.options.step = grid.step;
  problem.guess = guess_of(arguments, problem);
  const BoundaryReport report = solve_boundary_values(problem);
  if (!arguments.out.empty()) write_motion(arguments.out, report, *entry.scene);
  const std::string method =
      Integrator(entry.scene, session.registry, session.solvers, problem.options).method().name;
  print(arguments.json ? boundary_json(report, problem, method) : boundary_text(report, problem, method));
  if (report.converged && !report.doubt.empty()) {
    say("doubted: " + report.doubt);
    session.exit_status = doubted;
  }
  if (report.converged) return;
  say(report.ending);
  session.exit_status = failed;
}

}  // namespace

void add_boundary(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "boundary", "The motion between two places, with other conditions on both ends, or a periodic one");
  const auto arguments = std::make_shared<BoundaryArguments>();
  add_solver_options(*verb, session);
  add_redundancy_option(*verb, session);
  verb->add_option("SCENE", arguments->scene, "A scene; see diracstep list scenes")->required();
  verb->add_option("--from", arguments->from,
                   "A coordinate at the start, v_ or p_ before it its velocity or momentum; without, all "
                   "coordinates are those of the scene's start")
      ->type_name("NAME=VALUE");
  verb->add_option("--to", arguments->to, "The same at the end")->type_name("NAME=VALUE");
  verb->add_flag("--periodic", arguments->periodic, "Coordinates and velocities at the end as at the start");
  verb->add_option("--end", arguments->end, "Time of the end; the scene's own without it");
  verb->add_option("--step", arguments->step, "Step size; the scene's own without it");
  verb->add_option(
          "--guess", arguments->guess,
          "CSV file with columns t, coordinates and v_NAME, as --out of run and this verb writes "
          "them; without, a straight line between two places, else the motion from the scene's start")
      ->type_name("FILE");
  add_method_options(*verb, arguments->method);
  verb->add_option("--out", arguments->out, "CSV file for the motion: t, coordinates, v_NAME, p_NAME")
      ->type_name("FILE");
  add_set_option(*verb, arguments->set);
  verb->add_flag("--json", arguments->json, "One JSON document on standard output");
  verb->footer(
      "Examples:\n"
      "  diracstep boundary kepler_e06 --from x=1 y=0 --to x=-0.3 y=1.1 --end 2.1 --out transfer.csv\n"
      "  diracstep boundary lotka_volterra_2d --periodic --end 5");
  verb->callback([arguments, &session] { run_boundary(*arguments, session); });
}

}  // namespace diracstep::command
