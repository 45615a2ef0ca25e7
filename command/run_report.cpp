#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/command/run_report.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>
#include <utility>

namespace diracstep::command {

namespace {

Json by_name(const std::vector<std::string>& names, const Vector& values) {
  Json json = Json::object();
  for (std::size_t i = 0; i < names.size(); ++i)
    add_member(json, names[i], values[static_cast<Eigen::Index>(i)]);
  return json;
}

Json end_json(const RunResult& result, const Scene& scene) {
  if (!result.has_end()) return nullptr;
  return {{"t", Json(result.end.time)},
          {"q", by_name(position_names(scene), result.end.q)},
          {"v", by_name(scene.coordinates, result.end.v)},
          {"p", by_name(scene.coordinates, result.end.p)},
          {"lambda", by_name(scene.row_names(), result.end.lambda)},
          {"energy", Json(result.end.energy)}};
}

/// Of a large scene the first few coordinates and rows are shown, and the last one.
constexpr int max_shown = 24, first_shown = 8;

/// Calls show(k) for those of `count` that are shown, in order, and leave_out(how many) for those between.
template <class Show, class LeaveOut>
void for_shown(int count, const Show& show, const LeaveOut& leave_out) {
  const int first = count <= max_shown ? count : first_shown;
  for (int k = 0; k < first; ++k) show(k);
  if (first == count) return;
  leave_out(count - first - 1);
  show(count - 1);
}

/// Of a group or a sphere there are more numbers of q than of v and p.
std::string places_table(const Sample& end, const Scene& scene) {
  const std::vector<std::string> names = position_names(scene);
  std::vector<std::vector<std::string>> rows{{"", "q"}};
  for_shown(
      scene.storage_size(),
      [&](int i) {
        rows.push_back({names[static_cast<std::size_t>(i)], fmt::format("{:.15g}", end.q[i])});
      },
      [&](int) {
        rows.push_back({"…", ""});
      });
  return aligned(rows);
}

std::string end_table(const Sample& end, const Scene& scene) {
  const bool together = !scene.space;
  std::vector<std::vector<std::string>> rows{{"", together ? "q" : "", "v", "p"}};
  std::string left_out;
  const auto coordinate = [&](int i) {
    rows.push_back({scene.coordinates[static_cast<std::size_t>(i)],
                    together ? fmt::format("{:.15g}", end.q[i]) : "", fmt::format("{:.15g}", end.v[i]),
                    fmt::format("{:.15g}", end.p[i])});
  };
  for_shown(scene.dimension(), coordinate, [&](int count) {
    rows.push_back({"…", "", "", ""});
    left_out = fmt::format("{} of {} coordinates left out; --json and --out have them all\n", count,
                           scene.dimension());
  });
  std::string text = (together ? "" : places_table(end, scene)) + aligned(rows) + left_out;
  const auto names = scene.row_names();
  for_shown(
      scene.rows(),
      [&](int r) {
        text += fmt::format("force of row {}: {:.15g}\n", names[static_cast<std::size_t>(r)], end.lambda[r]);
      },
      [&](int count) { text += fmt::format("… {} of {} rows left out\n", count, scene.rows()); });
  return text;
}

std::string invariants_text(const RunResult& result) {
  std::string text;
  for (const InvariantEnds& ends : result.invariants) {
    text +=
        fmt::format("invariant {}: {:.15g}, changed by {:.2e}", ends.name, ends.end, ends.end - ends.start);
    if (ends.stated)
      text += fmt::format(", stated {:.15g}, off by {:.2e}", *ends.stated, ends.end - *ends.stated);
    text += '\n';
  }
  return text;
}

Json invariants_json(const RunResult& result) {
  Json json = Json::array();
  for (const InvariantEnds& ends : result.invariants)
    json.push_back({{"name", ends.name},
                    {"start", Json(ends.start)},
                    {"end", Json(ends.end)},
                    {"stated", ends.stated ? Json(*ends.stated) : Json(nullptr)}});
  return json;
}

std::string outputs_text(const RunResult& result) {
  std::string text;
  for (const auto& [name, value] : result.outputs) text += fmt::format("output {}: {:.15g}\n", name, value);
  return text;
}

Json outputs_json(const RunResult& result) {
  Json json = Json::object();
  for (const auto& [name, value] : result.outputs) add_member(json, name, Json(value));
  return json;
}

std::string sensitivities_text(const RunResult& result, const Scene& scene) {
  std::string text;
  for (const SensitivityColumn& column : result.sensitivities) {
    std::vector<std::vector<std::string>> rows{{fmt::format("d/d({})", column.by), "q", "v", "p"}};
    for_shown(
        scene.dimension(),
        [&](int i) {
          rows.push_back({scene.coordinates[static_cast<std::size_t>(i)], fmt::format("{:.15g}", column.q[i]),
                          column.v.size() > 0 ? fmt::format("{:.15g}", column.v[i]) : "",
                          fmt::format("{:.15g}", column.p[i])});
        },
        [&](int) {
          rows.push_back({"…", "", "", ""});
        });
    text += aligned(rows);
  }
  return text;
}

Json sensitivities_json(const RunResult& result, const Scene& scene) {
  Json json = Json::object();
  for (const SensitivityColumn& column : result.sensitivities) {
    Json by{{"q", by_name(position_names(scene), column.q)}, {"p", by_name(scene.coordinates, column.p)}};
    by["v"] = column.v.size() > 0 ? by_name(scene.coordinates, column.v) : Json(nullptr);
    add_member(json, column.by, by);
  }
  return json;
}

std::string events_text(const RunResult& result) {
  constexpr std::size_t most = 20;
  std::string text;
  for (std::size_t k = 0; k < std::min(most, result.hits.size()); ++k)
    text += fmt::format("event {}: t = {:.15g}\n", result.events[result.hits[k].event].name,
                        result.hits[k].sample.time);
  if (result.hits.size() > most)
    text += fmt::format("… {} of {} events left out; --json has them all\n", result.hits.size() - most,
                        result.hits.size());
  return text;
}

Json events_json(const RunResult& result, const Scene& scene) {
  Json json = Json::array();
  for (const EventHit& hit : result.hits) {
    json.push_back({{"name", result.events[hit.event].name},
                    {"t", Json(hit.sample.time)},
                    {"q", by_name(position_names(scene), hit.sample.q)},
                    {"v", by_name(scene.coordinates, hit.sample.v)}});
    if (hit.after)
      json.back()["after"] = {{"q", by_name(position_names(scene), hit.after->q)},
                              {"v", by_name(scene.coordinates, hit.after->v)}};
    if (result.events[hit.event].restitution) json.back()["impulse"] = Json(hit.impulse);
  }
  return json;
}

/// "ok", "doubted" or why the run failed.
std::string status(const RunResult& result) {
  if (!result.failure.empty()) return result.failure;
  return result.doubt.empty() ? "ok" : "doubted";
}

Json retries_json(const Retries& retries) {
  return {{"line_searches", retries.line_searches},           {"plain_guesses", retries.plain_guesses},
          {"previous_solutions", retries.previous_solutions}, {"continuations", retries.continuations},
          {"other_branches", retries.other_branches},         {"divided_steps", retries.divided_steps}};
}

std::string retries_text(const Retries& retries) {
  if (retries.total() == 0) return {};
  std::string text = "retries:";
  for (const auto& [count, what] : {std::pair{retries.line_searches, "line searches"},
                                    {retries.plain_guesses, "plain guesses"},
                                    {retries.previous_solutions, "previous solutions"},
                                    {retries.continuations, "solutions followed from small steps"},
                                    {retries.other_branches, "other solutions replaced"},
                                    {retries.divided_steps, "divided steps"}})
    if (count > 0) text += fmt::format("{} {} {}", text.back() == ':' ? "" : ",", count, what);
  return text + '\n';
}

std::string search_text(const ErrorControlReport& search) {
  std::string text = search_table(search);
  if (!search.division.empty()) text += search.division + '\n';
  if (search.ok())
    text += fmt::format("estimated error {:.2e}, {}, {} solves in all\n", search.estimate, search.grounds,
                        search.work.solves);
  return text + (search.warning.empty() ? "" : "warning: " + search.warning + "\n") + "\n";
}

Json variable_json(const VariableSteps& steps) {
  const ControlReport& report = steps.report;
  return {{"eps", steps.eps},
          {"control", name(steps.control)},
          {"smallest_step", Json(report.smallest_step)},
          {"largest_step", report.largest_step},
          {"rate_ratio", Json(report.fastest / report.slowest)},
          {"resets", report.resets},
          {"refused", report.refused},
          {"side_steps", report.side_steps},
          {"accelerations", report.accelerations}};
}

Json search_json(const ErrorControlReport& search) {
  Json json{{"adaptive", search.adaptive},
            {"reason", search.reason},
            {"step", search.step},
            {"estimate", Json(search.estimate)},
            {"observed_order", Json(search.observed_order)},
            {"grounds", search.ok() ? Json(search.grounds) : Json(nullptr)},
            {"division", search.division.empty() ? Json(nullptr) : Json(search.division)},
            {"warning", search.warning.empty() ? Json(nullptr) : Json(search.warning)},
            {"refusal", search.refusal.empty() ? Json(nullptr) : Json(search.refusal)},
            {"solves", search.work.solves},
            {"runs", Json::array()}};
  for (const ErrorControlRun& run : search.runs)
    json["runs"].push_back({{"step", run.step},
                            {"steps", run.steps},
                            {"solves", run.solves},
                            {"difference", Json(run.difference)},
                            {"estimate", Json(run.estimate)},
                            {"observed_order", Json(run.observed_order)},
                            {"status", run.failure.empty() ? "ok" : run.failure}});
  return json;
}

double energy_change(const RunResult& result, const CatalogueScene& entry) {
  const auto scene = completed(entry.scene);
  return result.end.energy - scene->energy(scene->start);
}

}  // namespace

void compare_with_reference(RunResult& result, const CatalogueScene& entry, const Scene& scene) {
  if (!result.has_end()) return;
  const Scene& at_end = result.scene_at_end ? *result.scene_at_end : scene;
  const bool known = entry.reference.at && entry.reference.at(result.end.time);
  ReferenceEnd reference{.kind = {}, .how = {}, .missing = "no reference", .q = {}, .p = {}};
  if (known) reference = reference_end(entry, result.end.time);
  judge(result.check, at_end, result.end, reference);
}

std::string run_text(const RunResult& result, const CatalogueScene& entry, const IntegratorOptions& options) {
  const bool fixed = !result.variable && !(result.search && result.search->adaptive);
  std::string text = result.search ? search_text(*result.search) : "";
  text +=
      fmt::format("{}: {}, order {}, {} {}, momentum {}\n", entry.scene->name, options.method, options.order,
                  result.work.steps, fixed ? fmt::format("steps of {:g}", options.step) : "variable steps",
                  name(result.momentum));
  if (result.variable) text += summary(*result.variable);
  if (result.has_end()) {
    text +=
        fmt::format("\nt = {:.10g}\n{}energy: {:.15g}, changed by {:.2e}\n", result.end.time,
                    end_table(result.end, entry.shown()), result.end.energy, energy_change(result, entry));
    text += invariants_text(result) + outputs_text(result) + events_text(result);
    text += sensitivities_text(result, *entry.scene);
    if (std::isfinite(result.check.error_q))
      text += fmt::format(
          "error against the {} reference: q {:.2e}{}\n", entry.reference.kind, result.check.error_q,
          std::isfinite(result.check.error_p) ? fmt::format(", p {:.2e}", result.check.error_p)
                                              : std::string());
    if (entry.shown().rows() > 0)
      text += fmt::format("largest residual of the constraint rows: {:.2e}\n", result.check.constraint);
  }
  text +=
      fmt::format("work: {} solves, {} Newton iterations, {} residuals, {} Jacobians\n", result.work.solves,
                  result.work.iterations, result.work.residual_evaluations, result.work.jacobian_evaluations);
  return text + retries_text(result.work.retries);
}

std::string run_json(const RunResult& result, const CatalogueScene& entry, const IntegratorOptions& options) {
  const StudyRow& check = result.check;
  Json json{{"scene", entry.scene->name},
            {"parameters", Json::object()},
            {"method", options.method},
            {"order", options.order},
            {"momentum", name(result.momentum)},
            {"step", result.variable || (result.search && result.search->adaptive) ? Json(nullptr)
                                                                                   : Json(options.step)},
            {"status", status(result)}};
  for (const auto& [key, value] : entry.parameters) json["parameters"][key] = Json(value);
  json["doubt"] = result.doubt.empty() ? Json(nullptr) : Json(result.doubt);
  json["end"] = end_json(result, entry.shown());
  json["error_q"] = Json(check.error_q);
  json["error_p"] = Json(check.error_p);
  json["constraint"] = Json(check.constraint);
  json["energy_error"] = Json(check.energy_error);
  json["invariants"] = invariants_json(result);
  json["outputs"] = outputs_json(result);
  if (!result.sensitivities.empty()) json["sensitivities"] = sensitivities_json(result, *entry.scene);
  json["events"] = events_json(result, *entry.scene);
  json["stopped"] = result.stopped;
  json["steps"] = result.work.steps;
  json["newton_iterations"] = result.work.iterations;
  json["residual_evaluations"] = result.work.residual_evaluations;
  json["jacobian_evaluations"] = result.work.jacobian_evaluations;
  json["retries"] = retries_json(result.work.retries);
  json["out"] = result.out.empty() ? Json(nullptr) : Json(result.out);
  json["points"] = result.lines;
  if (result.variable) json["adaptive"] = variable_json(*result.variable);
  if (result.search) json["error_control"] = search_json(*result.search);
  return to_text(json, 2) + '\n';
}

}  // namespace diracstep::command
