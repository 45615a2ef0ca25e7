#include <fmt/format.h>

#include <CLI/App.hpp>
#include <diracstep/validation/command/arguments.hpp>
#include <diracstep/validation/command/verbs.hpp>
#include <diracstep/validation/report.hpp>
#include <diracstep/validation/scene_examination.hpp>
#include <memory>
#include <nlohmann/json.hpp>

namespace diracstep::command {

namespace {

struct Options {
  std::string scene;
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

void check(const Options& options, Session& session) {
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
  verb->add_option("SCENE", options->scene, "A scene file NAME.toml, or a scene of the catalogue")
      ->required();
  verb->add_option("--set", options->set, "Set a parameter or size of the scene; may be repeated")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer("Example:  diracstep check my_pendulum.toml");
  verb->callback([options, &session] { check(*options, session); });
}

}  // namespace diracstep::command
