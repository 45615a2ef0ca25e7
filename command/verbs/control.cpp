#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <diracstep/boundary_values/guesses.hpp>
#include <diracstep/boundary_values/named_ends.hpp>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/guess_file.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/motion_search.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/parametric_scene_file.hpp>
#include <memory>

namespace diracstep::command {

namespace {

struct ControlArguments : MotionSearchArguments {
  std::vector<std::string> at_least, at_most;
  int degree = 0, iterations = 500;
  double tolerance = 1e-9;
};

constexpr int most_coordinates_of_control = 40;  // shown

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
  std::string text = first_line(scene, report.times, problem.steps, method, report.iterations) + "\n\n";
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
  const Eigen::Index points = report.controls.cols() / problem.steps;
  write_motion(path, *problem.controlled.scene, {report.times, report.q, report.v, report.p},
               problem.controlled.controls, [&](Eigen::Index k) -> Vector {
                 return report.controls.col(std::min(k * points, report.controls.cols() - 1));
               });
}

ControlProblem control_problem(ControlArguments& arguments, Session& session) {
  const CatalogueScene entry = searched_scene(arguments, session, "control");
  SceneControl control = scene_control(arguments.scene, entry, parameters(arguments.set));
  const StepGrid grid = searched_steps(arguments, entry);
  if (arguments.to.empty() && !control.end_cost)
    throw Misuse(
        "--to NAME=VALUE says what is asked of the end, or 'end_cost' of [control] what an end costs");
  const Scene& scene = *entry.scene;
  const Parameters to = parameters(arguments.to, "--to");
  ControlProblem problem{{entry.scene, control.names, control.force, control.cost, control.end_cost,
                          control.lower, control.upper, control.kinks},
                         session.registry,
                         session.solvers,
                         integrator_options(session, arguments.method),
                         grid.steps,
                         arguments.from.empty()
                             ? conditions_from_start(*completed(entry.scene), to)
                             : conditions_at_ends(scene, parameters(arguments.from, "--from"), to),
                         {}};
  problem.options.step = grid.step;
  problem.guessed_controls = control.values;
  problem.degree = arguments.degree;
  problem.max_iterations = arguments.iterations;
  problem.tolerance = arguments.tolerance;
  problem.go_on = [] { return !interrupted(); };
  set_bounds(problem, parameters(arguments.at_least, "--at-least"),
             parameters(arguments.at_most, "--at-most"));
  problem.guess = arguments.guess.empty() ? usual_guess(problem) : guess_from_file(arguments.guess, scene);
  return problem;
}

void run_control(ControlArguments arguments, Session& session) {
  const ControlProblem problem = control_problem(arguments, session);
  catch_interrupts();
  const OptimalControlReport report = [&] {
    const NothingKept searching;
    return solve_optimal_control(problem);
  }();
  if (!arguments.out.empty()) write_controlled(arguments.out, report, problem);
  const std::string method =
      Integrator(problem.controlled.scene, session.registry, session.solvers, problem.options).method().name;
  print(arguments.json ? control_json(report, problem, method) : control_text(report, problem, method));
  if (!report.doubt.empty()) {
    say("doubted: " + report.doubt);
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
  verb->add_option("--out", arguments->out,
                   "CSV file for the motion: t, coordinates, v_NAME, p_NAME, controls")
      ->type_name("FILE");
  add_search_options(*verb, session, *arguments);
  verb->footer(
      "Examples:\n"
      "  diracstep control blade.toml --to x=1 y=1 h=0 v_x=0 v_y=0 v_h=0 --out parking.csv\n"
      "  diracstep control transfer.toml --to r=1.2 v_r=0 --at-most u=0.05");
  verb->callback([arguments, &session] { run_control(*arguments, session); });
}

}  // namespace diracstep::command
