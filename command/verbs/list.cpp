#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/command/verbs/published_orders.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/names.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>
#include <iterator>
#include <memory>

namespace diracstep::command {

namespace {

struct ListArguments {
  std::string what;
  bool measure = false, parameters = false;
  bool json = false;
};

/// A measured order on one scene.
struct Measurement {
  std::string scene;
  std::optional<double> slope;
};
using Measurements = std::vector<Measurement>;

constexpr std::size_t line_width = 100;

/// The list, with the step and the parameters of each scene below it where they are asked for.
std::string scene_table(const Session& session, bool with_parameters) {
  std::vector<std::vector<std::string>> rows{{"scene", "size", "end", "class: description"}};
  for (const auto& name : scene_names(session)) {
    const CatalogueScene entry = make_scene(session, name);
    const std::string needs = entry.needs.empty() ? "" : " (not run yet)";
    rows.push_back({name, fmt::format("{} + {}", entry.scene->dimension(), entry.scene->rows()),
                    fmt::format("{:.4g}", entry.t_end),
                    fmt::format("{}{}: {}", entry.kind, needs, entry.description)});
    if (!with_parameters) continue;
    std::string values = fmt::format("step {:g};", entry.natural_step);
    for (const auto& [key, value] : entry.parameters) values += fmt::format(" {}={:.6g}", key, value);
    rows.push_back({"", "", "", values});
  }
  return aligned(rows, line_width) +
         fmt::format("\nsize: coordinates + rows; end: of the scene's own motion{}\n",
                     with_parameters ? "" : "; --parameters tells what --set changes");
}

/// By the definition of the scene, which names the rates of states.
std::vector<std::string> states_of(const CatalogueScene& entry) {
  constexpr std::string_view rate = "rate of ";
  std::vector<std::string> names;
  for (const auto& [what, formula] : entry.definition)
    if (what.starts_with(rate)) names.push_back(what.substr(rate.size()));
  return names;
}

std::vector<std::string> names_of_events(const CatalogueScene& entry) {
  std::vector<std::string> names;
  for (const Event& event : entry.events) names.push_back(event.name);
  return names;
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
                      {"states", states_of(entry)},
                      {"events", names_of_events(entry)},
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
  constexpr double largest_error = 1e-8;  // of closed forms: those of fields are farther from their grids
  Measurements measurements;
  for (const auto& name : ::diracstep::scene_names()) {
    const CatalogueScene entry = ::diracstep::make_scene(name);
    const double start = entry.scene->start.time;
    const double end = std::min(entry.t_end, start + natural_steps * entry.natural_step);
    if (!entry.needs.empty() || !entry.reference.at || !entry.reference.at(end) ||
        entry.reference.self_error > largest_error)
      continue;
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

/// The methods of the registry, and those of more Gauss-Lobatto stages that studies use.
std::vector<std::string> listed_methods(const Session& session) {
  std::vector<std::string> names = session.registry.names();
  for (const char* type : {"type1", "type2", "type3"}) {
    const auto last = std::ranges::find(names, fmt::format("{}/gl:4", type));
    names.insert(last + 1, {fmt::format("{}/gl:5", type), fmt::format("{}/gl:6", type)});
  }
  return names;
}

/// The slopes just measured, or those of the published table.
std::vector<double> slopes(const MethodInfo& info, const std::optional<Measurements>& measured) {
  std::vector<double> all;
  if (measured) {
    for (const Measurement& measurement : *measured)
      if (measurement.slope) all.push_back(*measurement.slope);
  } else {
    for (const PublishedOrder& published : published_orders(info.name, info.order))
      all.push_back(published.slope);
  }
  return all;
}

std::string range(const std::vector<double>& slopes) {
  if (slopes.empty()) return "-";
  const auto [least, most] = std::ranges::minmax(slopes);
  if (fmt::format("{:.2f}", least) == fmt::format("{:.2f}", most)) return fmt::format("{:.2f}", least);
  return fmt::format("{:.2f} to {:.2f}", least, most);
}

/// Of each method what was measured, by its place in the list; empty where nothing was to be measured.
using AllMeasured = std::vector<Measurements>;

std::optional<Measurements> measured_of(const AllMeasured& all, std::size_t i) {
  return all.empty() ? std::nullopt : std::optional(all[i]);
}

std::string method_table(const Session& session, const AllMeasured& measured) {
  std::vector<std::vector<std::string>> rows{{"method", "order", "measured", "composed to", "summary"}};
  const auto names = listed_methods(session);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const MethodInfo info = session.registry.method(names[i]).info;
    const int most = std::ranges::max(possible_orders(info));
    rows.push_back({info.name, fmt::format("{}", info.order), range(slopes(info, measured_of(measured, i))),
                    most > info.order ? fmt::format("{}", most) : "-",
                    info.solved_as.empty() ? info.summary : info.summary + "; " + info.solved_as});
  }
  const std::string source =
      measured.empty()
          ? "\nmeasured: smallest and largest over the classes of scenes of docs/orders.md, which\n"
            "diracstep orders writes; -: its error is at round-off before the order shows, or it "
            "is a plugin's\n"
          : "\nmeasured: smallest and largest over the scenes that have a closed form, just now\n";
  return aligned(rows, line_width) + source;
}

Json slopes_json(const MethodInfo& info, const std::optional<Measurements>& measured) {
  Json json;  // null where nothing is known
  if (!measured) {
    for (const PublishedOrder& published : published_orders(info.name, info.order))
      json.push_back({{"class", published.scene_class}, {"slope", published.slope}});
    return json;
  }
  for (const auto& [scene, slope] : *measured)
    json.push_back({{"scene", scene}, {"slope", slope ? Json(*slope) : Json(nullptr)}});
  return json;
}

Json method_json(const Session& session, const AllMeasured& measured) {
  Json methods = Json::array();
  const auto names = listed_methods(session);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const MethodInfo info = session.registry.method(names[i]).info;
    methods.push_back({{"name", info.name},
                       {"type", info.type ? Json(static_cast<int>(*info.type)) : Json()},
                       {"order", info.order},
                       {"measured_order", slopes_json(info, measured_of(measured, i))},
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

AllMeasured measure_all(const Session& session) {
  Progress progress;
  AllMeasured measured;
  for (const auto& method : listed_methods(session)) measured.push_back(measure(method, session, progress));
  return measured;
}

void list(const ListArguments& options, Session& session) {
  const std::vector<std::string> known{"scenes", "methods", "plugins"};
  if (!options.what.empty() && std::ranges::find(known, options.what) == known.end())
    throw Misuse(fmt::format("list: '{}' is not one of {}{}", options.what, fmt::join(known, ", "),
                             did_you_mean(options.what, known)));
  if (options.measure) catch_interrupts();
  const auto wanted = [&](const char* what) { return options.what.empty() || options.what == what; };
  AllMeasured measured;
  if (options.measure && wanted("methods")) measured = measure_all(session);
  Json json = Json::object();
  std::vector<std::string> tables;
  if (wanted("scenes")) {
    json["scenes"] = scene_json(session);
    tables.push_back(scene_table(session, options.parameters));
  }
  if (wanted("methods")) {
    json["methods"] = method_json(session, measured);
    tables.push_back(method_table(session, measured));
  }
  if (wanted("plugins")) {
    json["plugins"] = plugin_json(session);
    tables.push_back(plugin_table(session));
  }
  print(options.json ? to_text(json, 2) + '\n' : fmt::format("{}", fmt::join(tables, "\n")));
  if (!interrupted()) return;
  say("interrupted");
  session.exit_status = failed;
}

}  // namespace

void add_list(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand("list", "Scenes, methods and plugins");
  const auto options = std::make_shared<ListArguments>();
  verb->add_option("WHAT", options->what, "scenes, methods or plugins; everything without it");
  verb->add_flag("--parameters", options->parameters, "Below each scene its parameters, which --set changes");
  verb->add_flag("--measure", options->measure, "Measure the orders now, on scenes with a closed form");
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer("Example:  diracstep list methods --measure");
  verb->callback([options, &session] { list(*options, session); });
}

}  // namespace diracstep::command
