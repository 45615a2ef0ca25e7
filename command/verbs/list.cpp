#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>

namespace diracstep::command {

namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string what;
  bool measure = false;
  bool json = false;
};

/// A measured order on one scene.
struct Measurement {
  std::string scene;
  std::optional<double> slope;
};
using Measurements = std::vector<Measurement>;

std::string scene_table(const Session& session) {
  std::vector<std::vector<std::string>> rows{
      {"scene", "class", "coordinates", "rows", "t_end", "step", "parameters", "description"}};
  for (const auto& name : scene_names(session)) {
    const CatalogueScene entry = make_scene(session, name);
    std::vector<std::string> parameters;
    for (const auto& [key, value] : entry.parameters)
      parameters.push_back(fmt::format("{}={:.6g}", key, value));
    const std::string needs = entry.needs.empty() ? "" : " (not run yet)";
    rows.push_back({name, entry.kind + needs, fmt::format("{}", entry.scene->dimension()),
                    fmt::format("{}", entry.scene->rows()), fmt::format("{:g}", entry.t_end),
                    fmt::format("{:g}", entry.natural_step), fmt::format("{}", fmt::join(parameters, " ")),
                    entry.description});
  }
  return aligned(rows);
}

Json scene_json(const Session& session) {
  Json scenes = Json::array();
  for (const auto& name : scene_names(session)) {
    const CatalogueScene entry = make_scene(session, name);
    Json parameters = Json::object();
    for (const auto& [key, value] : entry.parameters) parameters[key] = value;
    scenes.push_back({{"name", name},
                      {"class", entry.kind},
                      {"coordinates", entry.scene->coordinates},
                      {"rows", entry.scene->row_names()},
                      {"t_end", entry.t_end},
                      {"natural_step", entry.natural_step},
                      {"parameters", parameters},
                      {"reference", entry.reference.kind},
                      {"needs", entry.needs},
                      {"description", entry.description},
                      {"source", entry.source}});
  }
  return scenes;
}

/// The method's order by a short study of each scene that it fits and that has a closed form.
Measurements measure(const std::string& method, const Session& session, Progress& progress) {
  constexpr double natural_steps = 11.3;  // length of the motions, no multiple of a period
  Measurements measurements;
  for (const auto& name : ::diracstep::scene_names()) {
    const CatalogueScene entry = ::diracstep::make_scene(name);
    const double start = entry.scene->start.time;
    const double end = std::min(entry.t_end, start + natural_steps * entry.natural_step);
    if (!entry.needs.empty() || !entry.reference.at || !entry.reference.at(end)) continue;
    try {
      const Study study = convergence_study(entry, session.registry, session.solvers,
                                            {.methods = {method},
                                             .orders = {session.registry.method(method).info.order},
                                             .rtols = {},
                                             .repeats = 1,
                                             .t_end = end,
                                             .run_budget = 0.02},
                                            [&](double part, const std::string& what) {
                                              progress.show(part, what);
                                              return !interrupted();
                                            });
      measurements.push_back({name, study.measured_orders.front().slope});
    } catch (const Misuse&) {
      continue;  // the method needs what this scene lacks
    }
  }
  return measurements;
}

std::string range(const Measurements& measurements) {
  std::vector<double> slopes;
  for (const auto& measurement : measurements)
    if (measurement.slope) slopes.push_back(*measurement.slope);
  if (slopes.empty()) return "-";
  const auto [least, most] = std::ranges::minmax(slopes);
  return fmt::format("{:.2f} to {:.2f} on {} of {} scenes", least, most, slopes.size(), measurements.size());
}

std::string method_table(const Session& session, const std::vector<Measurements>& measured) {
  std::vector<std::vector<std::string>> rows{
      {"method", "type", "order", "measured", "can be run at", "summary"}};
  const auto names = session.registry.names();
  for (std::size_t i = 0; i < names.size(); ++i) {
    const MethodInfo info = session.registry.method(names[i]).info;
    rows.push_back({info.name, fmt::format("{}", static_cast<int>(info.type)), fmt::format("{}", info.order),
                    measured.empty() ? "see --measure" : range(measured[i]),
                    fmt::format("{}", fmt::join(possible_orders(info), " ")),
                    info.solved_as.empty() ? info.summary : info.summary + "; " + info.solved_as});
  }
  return aligned(rows);
}

Json method_json(const Session& session, const std::vector<Measurements>& measured) {
  Json methods = Json::array();
  const auto names = session.registry.names();
  for (std::size_t i = 0; i < names.size(); ++i) {
    const MethodInfo info = session.registry.method(names[i]).info;
    Json slopes;  // null where nothing was measured
    for (const auto& [scene, slope] : measured.empty() ? Measurements{} : measured[i])
      slopes.push_back({{"scene", scene}, {"slope", slope ? Json(*slope) : Json(nullptr)}});
    methods.push_back({{"name", info.name},
                       {"type", static_cast<int>(info.type)},
                       {"order", info.order},
                       {"measured_order", slopes},
                       {"orders", possible_orders(info)},
                       {"self_adjoint", info.self_adjoint},
                       {"constraint_rule", name(info.constraint_rule)},
                       {"summary", info.summary},
                       {"solved_as", info.solved_as}});
  }
  return methods;
}

std::string plugin_table(const Session& session) {
  if (session.plugins.empty())
    return "no plugin is loaded; --plugin FILE.so and DIRACSTEP_PLUGIN_PATH load them\n";
  std::vector<std::vector<std::string>> rows{
      {"plugin", "interface", "methods", "rules", "scenes", "file", "description"}};
  for (const Plugin& plugin : session.plugins)
    rows.push_back({plugin.name(), fmt::format("{}", DIRACSTEP_PLUGIN_VERSION),
                    fmt::format("{}", fmt::join(plugin.methods(), " ")),
                    fmt::format("{}", fmt::join(plugin.rules(), " ")),
                    fmt::format("{}", fmt::join(plugin.scenes(), " ")), plugin.path(), plugin.description()});
  return aligned(rows);
}

Json plugin_json(const Session& session) {
  Json plugins = Json::array();
  for (const Plugin& plugin : session.plugins)
    plugins.push_back({{"name", plugin.name()},
                       {"interface", DIRACSTEP_PLUGIN_VERSION},
                       {"file", plugin.path()},
                       {"description", plugin.description()},
                       {"methods", plugin.methods()},
                       {"rules", plugin.rules()},
                       {"scenes", plugin.scenes()}});
  return plugins;
}

std::vector<Measurements> measure_all(const Session& session) {
  Progress progress;
  std::vector<Measurements> measured;
  for (const auto& method : session.registry.names()) measured.push_back(measure(method, session, progress));
  return measured;
}

void list(const Options& options, Session& session) {
  if (options.measure) catch_interrupts();
  const auto wanted = [&](const char* what) { return options.what.empty() || options.what == what; };
  std::vector<Measurements> measured;
  if (options.measure && wanted("methods")) measured = measure_all(session);
  Json json = Json::object();
  std::vector<std::string> tables;
  if (wanted("scenes")) {
    json["scenes"] = scene_json(session);
    tables.push_back(scene_table(session));
  }
  if (wanted("methods")) {
    json["methods"] = method_json(session, measured);
    tables.push_back(method_table(session, measured));
  }
  if (wanted("plugins")) {
    json["plugins"] = plugin_json(session);
    tables.push_back(plugin_table(session));
  }
  print(options.json ? json.dump(2) + '\n' : fmt::format("{}", fmt::join(tables, "\n")));
  if (!interrupted()) return;
  say("interrupted");
  session.exit_status = failed;
}

}  // namespace

void add_list(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand("list", "Scenes, methods and plugins");
  const auto options = std::make_shared<Options>();
  verb->add_option("WHAT", options->what, "scenes, methods or plugins; everything without it")
      ->check(CLI::IsMember({"scenes", "methods", "plugins"}));
  verb->add_flag("--measure", options->measure, "Measure the order of each method, beside the stated one");
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer("Example:  diracstep list methods --measure");
  verb->callback([options, &session] { list(*options, session); });
}

}  // namespace diracstep::command
