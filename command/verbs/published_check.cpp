#include <fmt/format.h>

#include <algorithm>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/verbs/published_check.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/validation/references/published_cases.hpp>

namespace diracstep::command {

namespace {

std::string as_json(const std::vector<PublishedCase>& cases) {
  Json json{{"cases", Json::array()}};
  for (const PublishedCase& one : cases)
    json["cases"].push_back({{"scene", one.scene},
                             {"method", one.run.method},
                             {"order", one.run.order},
                             {"step", one.run.step},
                             {"end", one.run.end},
                             {"component", one.component},
                             {"reference", one.published},
                             {"computed", one.computed},
                             {"error", one.error},
                             {"allowed", one.allowed},
                             {"kind", one.kind},
                             {"source", one.source},
                             {"passed", one.passed()},
                             {"failure", one.failure}});
  return to_text(json, 2) + '\n';
}

std::string as_text(const std::vector<PublishedCase>& cases) {
  std::vector<std::vector<std::string>> rows{
      {"scene", "method", "order", "step", "end", "reference", "error", "allowed", "result", "source"}};
  for (const PublishedCase& one : cases)
    rows.push_back(
        {one.scene, one.run.method, fmt::format("{}", one.run.order), fmt::format("{:.4g}", one.run.step),
         fmt::format("{:g}", one.run.end), fmt::format("{} = {:.14g}", one.component, one.published),
         fmt::format("{:.1e}", one.error), fmt::format("{:.0e}", one.allowed), one.passed() ? "pass" : "FAIL",
         one.failure.empty() ? one.kind + ": " + one.source : one.failure});
  return aligned(rows) +
         "\nerror: largest over positions and over velocities, each relative to the largest of them\n";
}

}  // namespace

void check_published_cases(bool json, Session& session) {
  std::vector<PublishedCase> cases;
  for (const std::string& name : scene_names(session)) {
    if (interrupted()) break;
    say(name);
    for (PublishedCase& one :
         run_published_cases(make_scene(session, name), session.registry, session.solvers))
      cases.push_back(std::move(one));
  }
  print(json ? as_json(cases) : as_text(cases));
  if (!std::ranges::all_of(cases, &PublishedCase::passed)) session.exit_status = failed;
  if (!interrupted()) return;
  say("interrupted");
  session.exit_status = failed;
}

}  // namespace diracstep::command
