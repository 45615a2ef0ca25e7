#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <diracstep/core/errors.hpp>
#include <diracstep/validation/command/arguments.hpp>
#include <diracstep/validation/command/interrupt.hpp>
#include <diracstep/validation/command/verbs.hpp>
#include <diracstep/validation/published_cases.hpp>
#include <diracstep/validation/report.hpp>
#include <diracstep/validation/scene_examination.hpp>
#include <memory>
#include <nlohmann/json.hpp>

namespace diracstep::command {

namespace {

struct Options {
  std::string scene;
  bool scenes = false;
  std::vector<std::string> set;
  bool json = false;
};

std::string as_json(const CatalogueScene& entry, const Examination& examination) {
  nlohmann::ordered_json json;
  json["scene"] = entry.scene->name;
  json["passed"] = examination.passed();
  json["formulas"] = entry.code;
  json["needs"] = entry.needs;
  json["findings"] = nlohmann::ordered_json::array();
  for (const Finding& finding : examination.findings)
    json["findings"].push_back(
        {{"what", finding.what}, {"passed", finding.passed}, {"detail", finding.detail}});
  json["advice"] = examination.advice;
  return json.dump(2) + '\n';
}

std::string as_text(const CatalogueScene& entry, const Examination& examination) {
  std::vector<std::vector<std::string>> rows{{"examined", "result", "detail"}};
  for (const Finding& finding : examination.findings)
    rows.push_back({finding.what, finding.passed ? "pass" : "FAIL", finding.detail});
  std::string text = fmt::format("{}: {}\n\n{}\nformulas: {}\n", entry.scene->name, entry.description,
                                 aligned(rows), entry.code);
  for (const auto& advice : examination.advice) text += "advice: " + advice + '\n';
  return text;
}

std::string as_json(const std::vector<PublishedCase>& cases) {
  nlohmann::ordered_json json{{"cases", nlohmann::json::array()}};
  for (const PublishedCase& one : cases)
    json["cases"].push_back({{"scene", one.scene},
                             {"method", one.run.method},
                             {"order", one.run.order},
                             {"step", one.run.step},
                             {"end", one.run.end},
                             {"component", one.component},
                             {"published", one.published},
                             {"computed", one.computed},
                             {"error", one.error},
                             {"allowed", one.allowed},
                             {"kind", one.kind},
                             {"source", one.source},
                             {"passed", one.passed()},
                             {"failure", one.failure}});
  return json.dump(2) + '\n';
}

std::string as_text(const std::vector<PublishedCase>& cases) {
  std::vector<std::vector<std::string>> rows{
      {"scene", "method", "order", "step", "end", "published", "error", "allowed", "result", "source"}};
  for (const PublishedCase& one : cases)
    rows.push_back(
        {one.scene, one.run.method, fmt::format("{}", one.run.order), fmt::format("{:.4g}", one.run.step),
         fmt::format("{:g}", one.run.end), fmt::format("{} = {:.14g}", one.component, one.published),
         fmt::format("{:.1e}", one.error), fmt::format("{:.0e}", one.allowed), one.passed() ? "pass" : "FAIL",
         one.failure.empty() ? one.kind + ": " + one.source : one.failure});
  return aligned(rows) +
         "\nerror: largest over positions and over velocities, each relative to the largest of them\n";
}

/// Every scene of the catalogue against the values that its file cites.
void check_scenes(const Options& options, Session& session) {
  std::vector<PublishedCase> cases;
  for (const std::string& name : scene_names()) {
    if (interrupted()) break;
    say(name);
    for (PublishedCase& one : run_published_cases(make_scene(name), session.registry, session.solvers))
      cases.push_back(std::move(one));
  }
  print(options.json ? as_json(cases) : as_text(cases));
  if (!std::ranges::all_of(cases, &PublishedCase::passed)) session.exit_status = failed;
}

void check(const Options& options, Session& session) {
  if (options.scenes != options.scene.empty()) throw Misuse("check takes either a scene or --scenes");
  if (options.scenes) return check_scenes(options, session);
  const CatalogueScene entry = make_scene(options.scene, parameters(options.set));
  const Examination examination = examine(entry, session.registry, session.solvers);
  print(options.json ? as_json(entry, examination) : as_text(entry, examination));
  if (!examination.passed()) session.exit_status = failed;
}

}  // namespace

void add_check(CLI::App& app, Session& session) {
  CLI::App* verb =
      app.add_subcommand("check", "Examination of a scene: rows, start, derivatives, regularity");
  const auto options = std::make_shared<Options>();
  verb->add_option("SCENE", options->scene, "A scene file NAME.toml, or a scene of the catalogue");
  verb->add_flag("--scenes", options->scenes,
                 "Run every scene of the catalogue as recommended, against the values its file cites");
  verb->add_option("--set", options->set, "Set a parameter or size of the scene; may be repeated")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer("Example:  diracstep check my_pendulum.toml");
  verb->callback([options, &session] { check(*options, session); });
}

}  // namespace diracstep::command
