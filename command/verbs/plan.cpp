#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/adaptive/damping_survey.hpp>
#include <diracstep/core/adaptive/rate_survey.hpp>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <memory>
#include <optional>

namespace diracstep::command {

namespace {

struct PlanArguments {
  std::string scene;
  MethodChoice method;
  bool adaptive = false;
  std::optional<double> eps;
  std::vector<std::string> set;
  bool json = false;
};

/// Above so many unknowns the arithmetic of a step takes far longer than what KINSOL does around it.
constexpr int largest_to_measure = 40;
constexpr int steps_to_measure = 48, max_rounds = 40;
constexpr std::clock_t enough = CLOCKS_PER_SEC / 200;

/// Processor time of the first steps, a mean of several rounds; NaN where one fails.
double seconds_of_steps(const CatalogueScene& entry, const Session& session, const SolverFactory& solvers,
                        const IntegratorOptions& options) {
  Integrator integrator(entry.scene, session.registry, solvers, options);
  const std::clock_t start = std::clock();
  int rounds = 0;
  while (rounds < max_rounds && std::clock() - start < enough) {
    integrator.reset();
    for (int k = 0; k < steps_to_measure; ++k)
      if (!integrator.step().ok()) return std::nan("");
    ++rounds;
  }
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / rounds;
}

/// What steps without KINSOL take of the time of those with it, measured.
void add_direct_line(const CatalogueScene& entry, const Session& session, const IntegratorOptions& options,
                     std::vector<PlanLine>& lines) {
  if (entry.scene->dimension() + entry.scene->rows() > largest_to_measure) return;
  const std::string other = session.solver == "direct" ? "newton" : session.solver;
  const double by_kinsol =
      seconds_of_steps(entry, session, named_solver(other, session.solver_options), options);
  const double direct =
      seconds_of_steps(entry, session, named_solver("direct", session.solver_options), options);
  if (!(by_kinsol > 0.0 && direct > 0.0)) return;
  lines.push_back({"--solver direct", fmt::format("{:.2f} of the time", direct / by_kinsol),
                   fmt::format("of --solver {}: {} steps measured now", other, steps_to_measure)});
}

std::string as_json(const Integrator& integrator, const std::vector<PlanLine>& lines) {
  Json json;
  json["scene"] = integrator.scene().name;
  json["method"] = integrator.options().method;
  json["order"] = integrator.options().order;
  json["plan"] = Json::array();
  for (const PlanLine& line : lines)
    json["plan"].push_back({{"item", line.item}, {"decision", line.decision}, {"reason", line.reason}});
  return to_text(json, 2) + '\n';
}

std::string as_text(const Integrator& integrator, const std::vector<PlanLine>& lines) {
  std::vector<std::vector<std::string>> rows{{"item", "decision", "reason"}};
  for (const PlanLine& line : lines) rows.push_back({line.item, line.decision, line.reason});
  return fmt::format("{} with {}, order {}\n\n{}", integrator.scene().name, integrator.options().method,
                     integrator.options().order, aligned(rows));
}

void plan(const PlanArguments& options, Session& session) {
  if (options.eps && !options.adaptive) throw Misuse("--eps needs --adaptive");
  const CatalogueScene entry = make_scene(session, options.scene, parameters(options.set));
  MethodChoice choice = options.method;
  std::optional<double> step;
  take_recommendation(entry, choice, step);
  IntegratorOptions used = integrator_options(session, choice);
  used.step = step.value_or(entry.natural_step);
  std::optional<DefaultMethod> chosen;
  if (used.method == automatic_method)
    chosen = default_method_of_motion(entry.scene, session.registry, session.solvers, entry.t_end,
                                      std::abs(used.step), used,
                                      {used.order, 0.0, used.constraint_rule, large_from(used.dense_limit)});
  const bool damped = session.registry.method(chosen ? chosen->method : used.method).info.damped;
  if (chosen && damped) used.method = chosen->method;
  const Integrator integrator(entry.scene, session.registry, session.solvers, used);
  std::vector<PlanLine> lines = integrator.plan();
  if (options.adaptive)
    lines = AdaptiveIntegrator(entry.scene, session.registry, session.solvers, used,
                               {.eps = options.eps.value_or(AdaptiveOptions{}.eps), .end = entry.t_end})
                .plan();
  else
    add_direct_line(entry, session, used, lines);
  if (chosen && damped) lines.insert(lines.begin(), {"method", "by default", chosen->reason});
  if (const std::string acting = acting_events(entry); !acting.empty())
    lines.push_back({"events", acting,
                     "a step in which one acts is taken up to its time, and the motion goes on from there"});
  for (const std::string& change : entry.changes) lines.push_back({"scene", "changed", change});
  if (choice.name != options.method.name)
    lines.push_back({"method", choice.name, "the scene's file recommends it"});
  if (choice.order != options.method.order)
    lines.push_back({"order", std::to_string(choice.order), "the scene's file recommends it"});
  if (damped)
    lines.push_back(
        {"variable steps", "by their local error",
         "--adaptive, and where the method is chosen by default: large where nothing fast is left"});
  else
    lines.push_back(
        variable_steps_line(entry.scene, session.solvers, entry.t_end, entry.natural_step, "--adaptive"));
  print(options.json ? as_json(integrator, lines) : as_text(integrator, lines));
}

}  // namespace

void add_plan(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand("plan", "What is assembled for a scene, and what is left out and why");
  add_solver_options(*verb, session);
  const auto options = std::make_shared<PlanArguments>();
  verb->add_option("SCENE", options->scene, "A scene; see diracstep list scenes")->required();
  add_method_options(*verb, options->method);
  verb->add_flag("--adaptive", options->adaptive, "The plan of steps of varying size");
  verb->add_option("--eps", options->eps,
                   "With --adaptive: radians of a step of varying size, 0.2 without; or its local error,\n"
                   "1e-6 without");
  add_redundancy_option(*verb, session);
  add_tolerance_option(*verb, session);
  add_set_option(*verb, options->set);
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer("Example:  diracstep plan knife_edge --method type1/midpoint --order 4");
  verb->callback([options, &session] { plan(*options, session); });
}

}  // namespace diracstep::command
