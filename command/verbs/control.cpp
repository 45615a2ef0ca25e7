#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <diracstep/boundary_values/optimal_control.hpp>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/end_conditions.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/near_names.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/parametric_scene_file.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <limits>
#include <memory>
#include <optional>

namespace diracstep::command {

namespace {

struct ControlArguments {
  std::string scene, guess, out;
  std::vector<std::string> from, to, set, at_least, at_most;
  bool json = false;
  int degree = 0, iterations = 500;
  double tolerance = 1e-9;
  MethodChoice method;
  std::optional<double> end, step;
};

constexpr int most_coordinates_of_control = 40;  // shown
constexpr long most_control_steps = 100'000;

/// Bounds NAME=VALUE of coordinates and controls.
void take_bounds(const std::vector<std::string>& assignments, const std::string& option, bool lower,
                 ControlProblem& problem) {
  const Scene& scene = *problem.controlled.scene;
  const std::vector<std::string>& controls = problem.controlled.controls;
  std::vector<std::string> known = scene.coordinates;
  known.insert(known.end(), controls.begin(), controls.end());
  const auto n = static_cast<std::size_t>(scene.dimension());
  for (const auto& [name, value] : parameters(assignments, option)) {
    const auto found = std::ranges::find(known, name);
    if (found == known.end())
      throw Misuse(fmt::format("{}: '{}' is neither a coordinate nor a control of scene '{}'{}", option, name,
                               scene.name, did_you_mean(name, known)));
    const auto place = static_cast<std::size_t>(found - known.begin());
    Vector& bounds = place < n ? (lower ? problem.lower_q : problem.upper_q)
                               : (lower ? problem.controlled.lower : problem.controlled.upper);
    bounds[static_cast<Eigen::Index>(place < n ? place : place - n)] = value;
  }
}

GuessedMotion guess_of_control(const ControlArguments& arguments, const ControlProblem& problem,
                               const Session& session) {
  const Scene& scene = *problem.controlled.scene;
  if (!arguments.guess.empty()) return guess_from_file(arguments.guess, scene);
  const BoundaryConditions& conditions = problem.conditions;
  if (!conditions.start_held || !conditions.end_held)
    return guess_from_start(problem.controlled.scene, session, problem.options, problem.steps);
  const int n = scene.dimension();
  const double t0 = scene.start.time;
  // Places at the end are the last conditions.
  return straight_line(t0, conditions.value.head(n),
                       t0 + static_cast<double>(problem.steps) * problem.options.step,
                       conditions.value.tail(n));
}

/// 0 where it is round-off beside others of its kind.
std::string shown_of(double value, double largest) {
  constexpr double round_off = 1e-15;
  return fmt::format("{:.10g}", std::abs(value) <= round_off * largest ? 0.0 : value);
}

std::string control_text(const OptimalControlReport& report, const ControlProblem& problem,
                         const std::string& method) {
  const Scene& scene = *problem.controlled.scene;
  const int n = scene.dimension();
  const Eigen::Index last = report.times.size() - 1;
  std::string text =
      fmt::format("{} from t = {:g} to {:g}: {} steps with {}, {} iterations\n\n", scene.name,
                  report.times[0], report.times[last], problem.steps, method, report.iterations);
  std::vector<std::vector<std::string>> rows{{"coordinate", "q at the start", "v", "q at the end", "v"}};
  for (int i = 0; i < std::min(n, most_coordinates_of_control); ++i) {
    auto& row = rows.emplace_back(std::vector<std::string>{scene.coordinates[static_cast<std::size_t>(i)]});
    for (const Eigen::Index k : {Eigen::Index{0}, last})
      for (const Columns* of : {&report.q, &report.v})
        row.push_back(shown_of((*of)(i, k), of->row(i).cwiseAbs().maxCoeff()));
  }
  text += aligned(rows);
  if (n > most_coordinates_of_control)
    text += fmt::format("… {} of {} coordinates left out; --out has them all\n",
                        n - most_coordinates_of_control, n);
  std::vector<std::vector<std::string>> controls{{"control", "least", "greatest"}};
  for (std::size_t k = 0; k < problem.controlled.controls.size(); ++k) {
    const auto values = report.controls.row(static_cast<Eigen::Index>(k));
    const double largest = values.cwiseAbs().maxCoeff();
    controls.push_back({problem.controlled.controls[k], shown_of(values.minCoeff(), largest),
                        shown_of(values.maxCoeff(), largest)});
  }
  text += '\n' + aligned(controls) + fmt::format("\ncost: {:.12g}\n", report.cost);
  return text + fmt::format("a run with these controls ends off by: {:.2g}\n", report.end_of_run);
}

std::string control_json(const OptimalControlReport& report, const ControlProblem& problem,
                         const std::string& method) {
  const Scene& scene = *problem.controlled.scene;
  const auto list = [](const Vector& values) {
    Json json = Json::array();
    for (const double value : values) json.push_back(Json(value));
    return json;
  };
  Json json{{"scene", scene.name},
            {"converged", report.converged},
            {"ending", report.ending},
            {"method", method},
            {"steps", problem.steps},
            {"step", problem.options.step},
            {"degree", problem.degree},
            {"iterations", report.iterations},
            {"cost", Json(report.cost)},
            {"residual", Json(report.residual)},
            {"end_of_run", Json(report.end_of_run)},
            {"times", list(report.times)},
            {"q", Json::object()},
            {"v", Json::object()},
            {"p", Json::object()},
            {"control_times", list(report.control_times)},
            {"controls", Json::object()}};
  for (int i = 0; i < scene.dimension(); ++i)
    for (const auto& [name, of] : {std::pair{"q", &report.q}, {"v", &report.v}, {"p", &report.p}})
      add_member(json[name], scene.coordinates[static_cast<std::size_t>(i)], list(of->row(i).transpose()));
  for (std::size_t k = 0; k < problem.controlled.controls.size(); ++k)
    add_member(json["controls"], problem.controlled.controls[k],
               list(report.controls.row(static_cast<Eigen::Index>(k)).transpose()));
  return to_text(json, 2) + '\n';
}

/// The controls of each row are those with which its step begins; of the last row those with which the last
/// step ends.
void write_controlled(const std::string& path, const OptimalControlReport& report,
                      const ControlProblem& problem) {
  std::string text = "t";
  for (const std::string& name : names_at_an_end(*problem.controlled.scene)) text += "," + csv_field(name);
  for (const std::string& name : problem.controlled.controls) text += "," + csv_field(name);
  text += '\n';
  const Eigen::Index points = report.controls.cols() / problem.steps;
  for (Eigen::Index k = 0; k < report.times.size(); ++k) {
    text += fmt::format("{:.17g}", report.times[k]);
    for (const Columns* of : {&report.q, &report.v, &report.p})
      for (const double value : of->col(k)) text += fmt::format(",{:.17g}", value);
    for (const double value : report.controls.col(std::min(k * points, report.controls.cols() - 1)))
      text += fmt::format(",{:.17g}", value);
    text += '\n';
  }
  OutputFile file(path, OutputFile::Mode::fresh);
  file.write(text);
  file.close();
}

ControlProblem control_problem(ControlArguments& arguments, Session& session) {
  const Parameters changes = parameters(arguments.set);
  const CatalogueScene entry = make_scene(session, arguments.scene, changes);
  require_flat(*entry.scene, "control");
  if (!entry.events.empty())
    throw Misuse("control does not go with the events of the scene: when one is met is not known before");
  SceneControl control = scene_control(arguments.scene, entry, changes);
  take_recommendation(entry, arguments.method, arguments.step);
  const StepGrid grid = fit_steps(entry.scene->start.time, arguments.end.value_or(entry.t_end),
                                  arguments.step.value_or(entry.natural_step));
  if (grid.steps > most_control_steps)
    throw Misuse(fmt::format("{} steps; {} are the most", grid.steps, most_control_steps));
  if (arguments.to.empty() && !control.end_cost)
    throw Misuse(
        "--to NAME=VALUE says what is asked of the end, or 'end_cost' of [control] what an end costs");
  const Scene& scene = *entry.scene;
  ControlProblem problem{{entry.scene, control.names, control.force, control.cost, control.end_cost,
                          control.lower, control.upper, control.kinks},
                         session.registry,
                         session.solvers,
                         integrator_options(session, arguments.method),
                         grid.steps,
                         arguments.from.empty() ? conditions_from_start(*completed(entry.scene), arguments.to)
                                                : conditions_at_ends(scene, arguments.from, arguments.to),
                         {}};
  problem.options.step = grid.step;
  problem.guessed_controls = control.values;
  problem.degree = arguments.degree;
  problem.max_iterations = arguments.iterations;
  problem.tolerance = arguments.tolerance;
  problem.go_on = [] { return !interrupted(); };
  constexpr double infinite = std::numeric_limits<double>::infinity();
  problem.lower_q = Vector::Constant(scene.dimension(), -infinite);
  problem.upper_q = -problem.lower_q;
  take_bounds(arguments.at_least, "--at-least", true, problem);
  take_bounds(arguments.at_most, "--at-most", false, problem);
  problem.guess = guess_of_control(arguments, problem, session);
  return problem;
}

void run_control(ControlArguments arguments, Session& session) {
  const ControlProblem problem = control_problem(arguments, session);
  catch_interrupts();
  const OptimalControlReport report = solve_optimal_control(problem);
  if (!arguments.out.empty()) write_controlled(arguments.out, report, problem);
  const std::string method =
      Integrator(problem.controlled.scene, session.registry, session.solvers, problem.options).method().name;
  print(arguments.json ? control_json(report, problem, method) : control_text(report, problem, method));
  constexpr double far_off = 1e-4;
  if (report.converged && !(report.end_of_run <= far_off)) {
    say(fmt::format(
        "doubted: a run with these controls ends off by {:.2g}, as where the motion is not "
        "stable, steps are too large, or it crosses a jump of the formulas within a step, where a "
        "run divides its step and this search does not",
        report.end_of_run));
    session.exit_status = doubted;
  }
  if (report.converged) return;
  say("not converged: " + report.ending);
  session.exit_status = failed;
}

}  // namespace

void add_control(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "control", "Controls that cost least, for a scene with a table [control]; needs Ipopt");
  const auto arguments = std::make_shared<ControlArguments>();
  add_solver_options(*verb, session);
  add_redundancy_option(*verb, session);
  verb->add_option("SCENE", arguments->scene, "A scene file with [control]")->required();
  verb->add_option("--from", arguments->from,
                   "A coordinate at the start, v_ or p_ before it its velocity or momentum; without, all "
                   "coordinates and velocities are those of the scene's start")
      ->type_name("NAME=VALUE");
  verb->add_option("--to", arguments->to, "The same at the end; what is not named is free")
      ->type_name("NAME=VALUE");
  verb->add_option("--at-least", arguments->at_least,
                   "Lower bound of a coordinate at the ends of steps, or of a control")
      ->type_name("NAME=VALUE");
  verb->add_option("--at-most", arguments->at_most, "Upper bound of the same")->type_name("NAME=VALUE");
  verb->add_option("--end", arguments->end, "Time of the end; the scene's own without it");
  verb->add_option("--step", arguments->step, "Step size; the scene's own without it");
  verb->add_option("--degree", arguments->degree,
                   "Of the polynomials in t that controls are in each step; below the points of a step")
      ->check(CLI::Range(0, 8))
      ->capture_default_str();
  verb->add_option("--iterations", arguments->iterations, "Most iterations of the search")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  verb->add_option("--optimality", arguments->tolerance, "Tolerance of the optimality conditions")
      ->check(CLI::Range(1e-14, 1.0))
      ->capture_default_str();
  verb->add_option("--guess", arguments->guess,
                   "CSV file with columns t, coordinates and v_NAME; without, a straight line between two "
                   "places, else the motion from the scene's start")
      ->type_name("FILE");
  add_method_options(*verb, arguments->method);
  verb->add_option("--out", arguments->out,
                   "CSV file for the motion: t, coordinates, v_NAME, p_NAME, controls")
      ->type_name("FILE");
  add_set_option(*verb, arguments->set);
  verb->add_flag("--json", arguments->json, "One JSON document on standard output");
  verb->footer(
      "Examples:\n"
      "  diracstep control blade.toml --to x=1 y=1 h=0 v_x=0 v_y=0 v_h=0 --out parking.csv\n"
      "  diracstep control transfer.toml --to r=1.2 v_r=0 --at-most u=0.05");
  verb->callback([arguments, &session] { run_control(*arguments, session); });
}

}  // namespace diracstep::command
