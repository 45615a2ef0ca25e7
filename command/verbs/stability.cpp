#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/files/written_file.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/files/paths.hpp>
#include <diracstep/reports/stability_report.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>
#include <diracstep/validation/studies/stability_cases.hpp>
#include <fstream>
#include <memory>
#include <optional>
#include <sstream>

namespace diracstep::command {

namespace {

struct StabilityArguments {
  std::vector<std::string> scenes;
  std::optional<std::string> methods, orders;
  std::vector<std::string> set;
  std::string out, write;
  bool without_ida = false, full = false, json = false;
};

constexpr const char* table_begin = "<!-- tables of diracstep stability -->\n";
constexpr const char* table_end = "<!-- end of the tables -->\n";

/// One of each construction: transforms of the same discrete Lagrangian take the same steps.
const std::vector<StabilityMethod> usual_methods{
    {"type1/midpoint", 2},    {"type1/midpoint", 4},
    {"type1/midpoint", 8},    {"type1/gl:2", 4},
    {"type1/gl:3", 6},        {"type1/gl:4", 8},
    {"damped/radau:3", 5},    {"type1/left", 1},
    {"type1/right", 1},       {"type1/trapezoidal", 2},
    {"type1/trapezoidal", 4}, {"type2/euler", 1},
    {"type3/euler", 1},       {"type4/legendre(type1/midpoint)", 2}};

/// Every other method of the registry at its own order.
void add_the_others(const Registry& registry, std::vector<StabilityMethod>& methods) {
  for (const std::string& name : registry.names())
    if (std::ranges::find(methods, name, &StabilityMethod::name) == methods.end())
      methods.push_back({name, registry.method(name).info.order});
}

std::vector<StabilityMethod> chosen_methods(const StabilityArguments& options, const Registry& registry) {
  std::vector<StabilityMethod> methods;
  if (!options.methods && !options.orders) {
    methods = usual_methods;
    if (options.full) add_the_others(registry, methods);
    return methods;
  }
  const std::vector<std::string> given =
      options.methods ? names("--methods", *options.methods) : registry.names();
  for (const std::string& name : given) {
    const MethodInfo info = registry.method(name).info;
    const std::vector<int> possible = possible_orders(info);
    const std::vector<int> wanted =
        options.orders ? whole_numbers("--orders", *options.orders) : std::vector<int>{info.order};
    for (const int order : wanted)
      if (std::ranges::find(possible, order) != possible.end()) methods.push_back({name, order});
  }
  if (methods.empty()) throw Misuse("--orders: none of the methods can be run at " + *options.orders);
  return methods;
}

/// The cases on each scene given, or the scene as it stands where there are none or its parameters are set.
std::vector<StabilityCase> chosen_cases(const StabilityArguments& options, const Session& session) {
  std::vector<StabilityCase> all = stability_cases(options.full);
  if (options.scenes.empty()) {
    if (!options.set.empty()) throw Misuse("--set needs a scene whose parameters are set");
    return all;
  }
  std::vector<StabilityCase> chosen;
  const Parameters changes = parameters(options.set);
  for (const std::string& scene : options.scenes) {
    const std::size_t before = chosen.size();
    if (changes.empty())
      std::ranges::copy_if(all, std::back_inserter(chosen),
                           [&](const StabilityCase& that) { return that.scene.scene->name == scene; });
    if (chosen.size() == before) chosen.push_back(stability_case(make_scene(session, scene, changes)));
  }
  return chosen;
}

/// The file with what stands between the two marks replaced.  Throws Misuse where it has no such marks.
std::string with_tables(const std::string& path, const std::string& tables) {
  constexpr std::size_t largest_page = 10'000'000;  // bytes
  const std::string text = read_file(path, "--write:", largest_page);
  const std::size_t begin = text.find(table_begin), end = text.find(table_end);
  if (begin == std::string::npos || end == std::string::npos || end < begin)
    throw Misuse(fmt::format("--write: '{}' has no lines '{}' and '{}' to write between", path,
                             std::string(table_begin, std::char_traits<char>::length(table_begin) - 1),
                             std::string(table_end, std::char_traits<char>::length(table_end) - 1)));
  return text.substr(0, begin) + table_begin + '\n' + tables + '\n' + text.substr(end);
}

std::vector<LinearStability> measure_linear(const std::vector<StabilityMethod>& methods,
                                            const Session& session, Progress& progress) {
  std::vector<LinearStability> linear;
  for (const StabilityMethod& method : methods) {
    if (interrupted()) break;
    progress.show(0.0, "linear stability: " + method.name);
    linear.push_back(linear_stability(session.registry, session.solvers, method.name, method.order));
  }
  return linear;
}

void require_written(const std::string& failure, Session& session) {
  if (failure.empty()) return;
  say(failure);
  session.exit_status = failed;
}

void write_directory(const std::filesystem::path& directory, const std::vector<LinearStability>& linear,
                     const std::vector<StabilityResult>& results, Session& session) {
  require_written(write_file(directory / "stability.json", stability_json(linear, results) + '\n'), session);
  require_written(write_file(directory / "stability.md", stability_markdown(linear, results)), session);
  if (const auto no_picture = draw_linear_stability(linear, directory); !no_picture.empty()) say(no_picture);
  if (const auto no_picture = draw_stability(results, directory); !no_picture.empty()) say(no_picture);
}

std::string text_of(const std::vector<LinearStability>& linear, const std::vector<StabilityResult>& results) {
  std::string text = linear_stability_table(linear);
  for (const StabilityResult& result : results) text += '\n' + stability_table(result);
  return text;
}

void stability(const StabilityArguments& options, Session& session) {
  const std::vector<StabilityMethod> methods = chosen_methods(options, session.registry);
  const std::vector<StabilityCase> cases = chosen_cases(options, session);
  const auto out = options.out.empty() ? std::nullopt : std::optional(output_directory(options.out));
  if (!options.write.empty()) {
    require_outputs({{"--write", options.write}}, {});
    (void)with_tables(options.write, {});
  }
  catch_interrupts();
  Progress progress;
  const std::vector<LinearStability> linear = measure_linear(methods, session, progress);
  const std::vector<StabilityResult> results =
      stability_study(cases, session.registry, session.solvers, methods, !options.without_ida,
                      [&](double part, const std::string& what) {
                        progress.show(part, what);
                        return !interrupted();
                      });
  progress.wipe();
  if (out) write_directory(*out, linear, results, session);
  if (!options.write.empty() && !interrupted())
    require_written(
        write_file(options.write, with_tables(options.write, stability_markdown(linear, results))), session);
  print(options.json ? stability_json(linear, results) + '\n' : text_of(linear, results));
  if (!interrupted()) return;
  say("interrupted; what was finished is there");
  session.exit_status = failed;
}

}  // namespace

void add_stability(CLI::App& app, Session& session) {
  CLI::App* verb =
      app.add_subcommand("stability", "Behaviour on stiff and extreme cases, with IDA beside it");
  const auto options = std::make_shared<StabilityArguments>();
  verb->add_option("SCENE", options->scenes, "Scenes; every stiff and extreme case without any");
  verb->add_option("--methods", options->methods,
                   "Methods, A,B,…; without it one of each construction,\nwith --full every method");
  verb->add_option("--orders", options->orders, "Orders, 2,4,…; each method's own without it");
  add_set_option(*verb, options->set);
  verb->add_flag("--without-ida", options->without_ida, "No runs of IDA");
  verb->add_flag("--full", options->full, "More cases, longer ones, and runs of 1e7 steps: hours");
  verb->add_option("--out", options->out, "Directory for stability.json, stability.md and pictures")
      ->type_name("DIR");
  verb->add_option("--write", options->write,
                   "Markdown file whose tables are replaced, between the marks that docs/stability.md has")
      ->type_name("FILE");
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer(
      "Examples:\n"
      "  diracstep stability --out results\n"
      "  diracstep stability stiff_spring_pendulum --methods type1/midpoint,type1/gl:3 --json");
  verb->callback([options, &session] { stability(*options, session); });
}

}  // namespace diracstep::command
