#include <fmt/format.h>

#include <CLI/App.hpp>
#include <cmath>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/adaptive/rate_survey.hpp>
#include <diracstep/core/integrator/integrator.hpp>
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
  double eps = 0.2;
  std::vector<std::string> set;
  bool json = false;
};

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
  const CatalogueScene entry = make_scene(session, options.scene, parameters(options.set));
  MethodChoice choice = options.method;
  std::optional<double> step;
  take_recommendation(entry, choice, step);
  IntegratorOptions used = integrator_options(session, choice);
  used.step = step.value_or(entry.natural_step);
  const Integrator integrator(entry.scene, session.registry, session.solvers, used);
  std::vector<PlanLine> lines = integrator.plan();
  if (options.adaptive)
    lines = AdaptiveIntegrator(entry.scene, session.registry, session.solvers, used,
                               {.eps = options.eps, .end = entry.t_end})
                .plan();
  for (const std::string& change : entry.changes) lines.push_back({"scene", "changed", change});
  if (choice.name != options.method.name)
    lines.push_back({"method", choice.name, "the scene's file recommends it"});
  lines.push_back(variable_steps_line(entry.scene, session.solvers, entry.t_end, entry.natural_step, "--adaptive"));
  print(options.json ? as_json(integrator, lines) : as_text(integrator, lines));
}

}  // namespace

void add_plan(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand("plan", "What is assembled for a scene, and what is left out and why");
  add_solver_options(*verb, session);
  const auto options = std::make_shared<PlanArguments>();
  verb->add_option("SCENE", options->scene, "A scene; see diracstep list scenes")->required();
  add_method_options(*verb, options->method);
  verb->add_flag("--adaptive", options->adaptive, "The plan of reversible steps of varying size");
  verb->add_option("--eps", options->eps, "Radians of a step of varying size")->capture_default_str();
  add_redundancy_option(*verb, session);
  add_set_option(*verb, options->set);
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer("Example:  diracstep plan knife_edge --method type1/midpoint --order 4");
  verb->callback([options, &session] { plan(*options, session); });
}

}  // namespace diracstep::command
