#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/command/verbs/published_check.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/validation/laws/count_allocations.hpp>
#include <diracstep/validation/laws/method_check.hpp>
#include <diracstep/validation/laws/scene_examination.hpp>
#include <memory>
#include <optional>

namespace diracstep::command {

namespace {

struct CheckArguments {
  std::vector<std::string> names;
  std::vector<std::string> set;
  bool scenes = false;
  bool json = false;
};

/// What there is to look at, by kind.
struct Wanted {
  std::vector<std::string> methods, rules, scenes;
};

bool is_method(const std::string& name) {
  const bool typed = name.size() > 6 && name.starts_with("type") && name[5] == '/';
  return (typed || name.starts_with("damped/")) && !is_scene_file(name);
}

/// The names given; without any all that the plugins bring, and without plugins every method.
Wanted wanted(const CheckArguments& options, const Session& session) {
  Wanted wanted;
  for (const std::string& name : options.names)
    (is_method(name) ? wanted.methods : wanted.scenes).push_back(name);
  if (!options.names.empty()) return wanted;
  const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  for (const Plugin& plugin : session.plugins) {
    append(wanted.methods, plugin.methods());
    append(wanted.rules, plugin.rules());
    append(wanted.scenes, plugin.scenes());
  }
  if (session.plugins.empty()) wanted.methods = session.registry.names();
  return wanted;
}

const char* describe(Check::Result result) {
  if (result == Check::Result::not_applicable) return "-";
  return result == Check::Result::pass ? "pass" : "FAIL";
}

std::string number(double value) { return std::isfinite(value) ? fmt::format("{:.3g}", value) : ""; }

std::string as_text(const ConformanceTable& table) {
  std::vector<std::vector<std::string>> rows{{"check", "result", "figure", "limit", "detail"}};
  for (const Check& check : table.checks)
    rows.push_back(
        {check.name, describe(check.result), number(check.figure), number(check.limit), check.detail});
  return fmt::format("{}: {}\n\n{}\n", table.subject, table.passed() ? "passes" : "FAILS", aligned(rows));
}

Json as_json(const char* kind, const ConformanceTable& table) {
  const auto number_or_null = [](double value) { return std::isfinite(value) ? Json(value) : Json(); };
  Json json{{kind, table.subject}, {"passed", table.passed()}, {"checks", Json::array()}};
  for (const Check& check : table.checks) {
    const bool applies = check.result != Check::Result::not_applicable;
    json["checks"].push_back({{"check", check.name},
                              {"passed", applies ? Json(check.result == Check::Result::pass) : Json()},
                              {"figure", number_or_null(check.figure)},
                              {"limit", number_or_null(check.limit)},
                              {"detail", check.detail}});
  }
  return json;
}

Json as_json(const CatalogueScene& entry, const Examination& examination) {
  Json json;
  json["scene"] = entry.scene->name;
  json["passed"] = examination.passed();
  json["formulas"] = entry.code;
  json["needs"] = entry.needs;
  json["findings"] = Json::array();
  for (const Finding& finding : examination.findings)
    json["findings"].push_back(
        {{"what", finding.what}, {"passed", finding.passed}, {"detail", finding.detail}});
  json["advice"] = examination.advice;
  return json;
}

std::string as_text(const CatalogueScene& entry, const Examination& examination) {
  std::vector<std::vector<std::string>> rows{{"examined", "result", "detail"}};
  for (const Finding& finding : examination.findings)
    rows.push_back({finding.what, finding.passed ? "pass" : "FAIL", finding.detail});
  const std::string described = entry.description.empty() ? "" : ": " + entry.description;
  std::string text =
      fmt::format("{}{}\n\n{}\nformulas: {}\n", entry.scene->name, described, aligned(rows), entry.code);
  for (const auto& advice : examination.advice) text += "advice: " + advice + '\n';
  return text;
}

/// Looks at one thing after the other and collects what is to be printed.
class Examiner {
 public:
  Examiner(const CheckArguments& options, Session& session) : options_(options), session_(session) {}

  void look_at(const Wanted& wanted) {
    if (!wanted.methods.empty() || !wanted.rules.empty()) order_scenes_ = order_scenes();
    for (const std::string& method : wanted.methods) {
      if (interrupted()) return;
      const auto proceed = [&](const std::string& what) {
        progress_.show(0.0, fmt::format("{}: {}", method, what));
        return !interrupted();
      };
      take("methods", "method",
           check_method(session_.registry, method, order_scenes_, {allocation_counter(), proceed}));
    }
    for (const std::string& rule : wanted.rules)
      take("rules", "rule", check_rule(session_.registry, rule, order_scenes_));
    for (const std::string& scene : wanted.scenes) take(scene);
  }

  void print_all() {
    if (!options_.json) return;
    if (document_.empty() && scenes_.size() == 1 && options_.names.size() == 1)
      return print(to_text(scenes_.front(), 2) + '\n');
    if (!scenes_.empty()) document_["scenes"] = scenes_;
    print(to_text(document_, 2) + '\n');
  }

 private:
  void take(const char* list, const char* kind, const ConformanceTable& table) {
    if (!table.passed()) session_.exit_status = failed;
    document_[list].push_back(as_json(kind, table));
    if (!options_.json) print(as_text(table));
  }

  void take(const std::string& scene) {
    if (interrupted()) return;
    std::optional<NothingKept> examining;
    if (scenes_.empty() && document_.empty()) examining.emplace();
    const CatalogueScene entry = make_scene(session_, scene, parameters(options_.set));
    const Examination examination = examine(entry, session_.registry, session_.solvers);
    if (!examination.passed()) session_.exit_status = failed;
    scenes_.push_back(as_json(entry, examination));
    if (!options_.json) print(as_text(entry, examination));
  }

  const CheckArguments& options_;
  Session& session_;
  std::vector<OrderScene> order_scenes_;
  Progress progress_;
  Json document_ = Json::object();  ///< methods and rules
  std::vector<Json> scenes_;
};

void check(const CheckArguments& options, Session& session) {
  catch_interrupts();
  if (options.scenes && !options.names.empty()) throw Misuse("check takes either names or --scenes");
  if (options.scenes) return check_published_cases(options.json, session);
  const Wanted all = wanted(options, session);
  for (const std::string& method : all.methods) (void)session.registry.method(method);  // misuse comes first
  Examiner examiner(options, session);
  examiner.look_at(all);
  examiner.print_all();
  if (!interrupted()) return;
  say("interrupted");
  session.exit_status = failed;
}

}  // namespace

void add_check(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "check",
      "Conformance of methods, built in or from a plugin: derivatives, laws, orders, behaviour;\n"
      "examination of scenes: rows, start, derivatives, regularity");
  const auto options = std::make_shared<CheckArguments>();
  verb->add_option("NAME", options->names,
                   "Methods, scene files NAME.toml, or scenes; without any all that the plugins\n"
                   "bring, and without plugins every method")
      ->type_name("METHOD|SCENE");
  verb->add_flag("--scenes", options->scenes,
                 "Run every scene of the catalogue as recommended, against the values its file cites");
  verb->add_option("--set", options->set, "Set a parameter or size of the scenes; may be repeated")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  add_redundancy_option(*verb, session);
  add_tolerance_option(*verb, session);
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer(
      "Examples:\n"
      "  diracstep check --plugin ./my_method.so\n"
      "  diracstep check type1/midpoint\n"
      "  diracstep check my_pendulum.toml");
  verb->callback([options, &session] { check(*options, session); });
}

}  // namespace diracstep::command
