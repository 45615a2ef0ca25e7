#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <diracstep/boundary_values/boundary_values.hpp>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/end_conditions.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
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

GuessedMotion guess_of(const BoundaryArguments& arguments, const BoundaryProblem& problem,
                       const Session& session) {
  if (!arguments.guess.empty()) return guess_from_file(arguments.guess, *problem.scene);
  const BoundaryConditions& conditions = problem.conditions;
  if (!conditions.start_held || !conditions.end_held)
    return guess_from_start(problem.scene, session, problem.options, problem.steps);
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
  return conditions_at_ends(scene, arguments.from, arguments.to);
}

double apart(const BoundaryReport& one, const BoundaryReport& other, double& size) {
  const Eigen::Index stride = (other.times.size() - 1) / (one.times.size() - 1);
  double off = 0.0;
  size = one.q.lpNorm<Eigen::Infinity>();
  for (Eigen::Index k = 0; k < one.times.size(); ++k)
    off = std::max(off, (one.q.col(k) - other.q.col(k * stride)).lpNorm<Eigen::Infinity>());
  return off;
}

/// Between two places: a solution of the discrete equations that is near no motion changes with the steps.
std::string doubt_of_steps(BoundaryProblem problem, const BoundaryReport& found) {
  constexpr double far = 0.02;  // of the largest coordinate
  problem.steps *= 2;
  problem.options.step *= 0.5;
  problem.guess = through_points(found.times, found.q, found.v);
  const BoundaryReport finer = solve_boundary_values(problem);
  if (interrupted()) return "interrupted before it was compared with that of steps of half the size";
  if (!finer.converged)
    return "with steps of half the size no motion is found near it: it is that of the steps";
  double size = 0.0;
  const double off = apart(found, finer, size);
  if (off <= far * size) return "";
  return fmt::format(
      "with steps of half the size the motion is another, up to {:.2g} off: steps are too large", off);
}

/// A second guess, and what it leads to.
std::string other_motion(BoundaryProblem problem, const BoundaryReport& found, const Session& session) {
  const BoundaryConditions& conditions = problem.conditions;
  if (!conditions.start_held || !conditions.end_held) return "";
  try {
    problem.guess = guess_from_start(problem.scene, session, problem.options, problem.steps);
  } catch (const Error&) {
    return "";
  }
  const BoundaryReport other = solve_boundary_values(problem);
  double size = 0.0;
  constexpr double same = 1e-6;
  if (!other.converged || apart(found, other, size) <= same * size) return "";
  return fmt::format(
      "another motion fulfils the conditions{}: the guess chooses; --guess FILE leads to others",
      other.action ? fmt::format(", of the action {:.6g}", other.action->value) : "");
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
  problem.go_on = [] { return !interrupted(); };
  problem.options.step = grid.step;
  problem.guess = guess_of(arguments, problem, session);
  catch_interrupts();
  BoundaryReport report = solve_boundary_values(problem);
  const bool places = report.converged && problem.conditions.start_held && problem.conditions.end_held;
  if (places && report.doubt.empty() && !interrupted()) report.doubt = doubt_of_steps(problem, report);
  if (!arguments.out.empty()) write_motion(arguments.out, report, *entry.scene);
  const std::string method =
      Integrator(entry.scene, session.registry, session.solvers, problem.options).method().name;
  print(arguments.json ? boundary_json(report, problem, method) : boundary_text(report, problem, method));
  if (places && arguments.guess.empty() && !interrupted())
    if (const std::string other = other_motion(problem, report, session); !other.empty()) say(other);
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
