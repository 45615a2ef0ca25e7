#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <diracstep/boundary_values/guesses.hpp>
#include <diracstep/boundary_values/named_ends.hpp>
#include <diracstep/boundary_values/other_solutions.hpp>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/guess_file.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/motion_search.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <memory>
#include <optional>
#include <utility>

namespace diracstep::command {

namespace {

struct BoundaryArguments : MotionSearchArguments {
  bool periodic = false;
};

constexpr int most_conditions_shown = 40;  // coordinates, multipliers

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
  std::string text = first_line(scene, report.times, problem.steps, method, report.iterations) + "\n\n";
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

BoundaryConditions conditions_of(const BoundaryArguments& arguments, const Scene& scene) {
  const int n = scene.dimension();
  if (arguments.periodic) {
    if (!arguments.from.empty() || !arguments.to.empty())
      throw Misuse("--periodic says all of both ends: it does not go with --from and --to");
    return periodic(n);
  }
  if (arguments.to.empty())
    throw Misuse("--to NAME=VALUE says what is asked of the end, or --periodic that it is as the start");
  return conditions_at_ends(scene, parameters(arguments.from, "--from"), parameters(arguments.to, "--to"));
}

void run_boundary(BoundaryArguments arguments, Session& session) {
  const CatalogueScene entry = searched_scene(arguments, session, "boundary");
  const StepGrid grid = searched_steps(arguments, entry);
  BoundaryProblem problem{entry.scene,
                          session.registry,
                          session.solvers,
                          integrator_options(session, arguments.method),
                          grid.steps,
                          conditions_of(arguments, *entry.scene),
                          {}};
  problem.go_on = [] { return !interrupted(); };
  problem.options.step = grid.step;
  problem.guess =
      arguments.guess.empty() ? usual_guess(problem) : guess_from_file(arguments.guess, *problem.scene);
  catch_interrupts();
  std::optional<NothingKept> searching(std::in_place);
  BoundaryReport report = solve_boundary_values(problem);
  const bool places = report.converged && problem.conditions.start_held && problem.conditions.end_held;
  if (places && report.doubt.empty() && !interrupted()) report.doubt = doubt_of_steps(problem, report);
  searching.reset();
  if (!arguments.out.empty())
    write_motion(arguments.out, *entry.scene, {report.times, report.q, report.v, report.p});
  const std::string method =
      Integrator(entry.scene, session.registry, session.solvers, problem.options).method().name;
  print(arguments.json ? boundary_json(report, problem, method) : boundary_text(report, problem, method));
  searching.emplace();
  if (places && arguments.guess.empty() && !interrupted())
    if (const std::string other = other_motion(problem, report); !other.empty()) say(other);
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
  verb->add_option("SCENE", arguments->scene, "A scene; see diracstep list scenes")->required();
  verb->add_option("--from", arguments->from,
                   "A coordinate at the start, v_ or p_ before it its velocity or momentum; without, all "
                   "coordinates are those of the scene's start")
      ->type_name("NAME=VALUE");
  verb->add_option("--to", arguments->to, "The same at the end")->type_name("NAME=VALUE");
  verb->add_flag("--periodic", arguments->periodic, "Coordinates and velocities at the end as at the start");
  verb->add_option(
          "--guess", arguments->guess,
          "CSV file with columns t, coordinates and v_NAME, as --out of run and this verb writes "
          "them; without, a straight line between two places, else the motion from the scene's start")
      ->type_name("FILE");
  verb->add_option("--out", arguments->out, "CSV file for the motion: t, coordinates, v_NAME, p_NAME")
      ->type_name("FILE");
  add_search_options(*verb, session, *arguments);
  verb->footer(
      "Examples:\n"
      "  diracstep boundary kepler_e06 --from x=1 y=0 --to x=-0.3 y=1.1 --end 2.1 --out transfer.csv\n"
      "  diracstep boundary lotka_volterra_2d --periodic --end 5");
  verb->callback([arguments, &session] { run_boundary(*arguments, session); });
}

}  // namespace diracstep::command
