#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/integrator/solved_start.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <memory>

namespace diracstep::command {

namespace {

struct StartArguments {
  std::string scene;
  std::vector<std::string> set;
  bool json = false;
};

constexpr int most_shown = 60;  // coordinates or rows on a screen
/// "0.5, given", or "guess, from 0.4".
std::string cell(double value, const StatedStart* stated, bool position, Eigen::Index i) {
  if (stated == nullptr) return fmt::format("{:.15g}", value);
  const Vector& before = position ? stated->start.q : stated->start.v;
  const StartOrigin origin = (position ? stated->q : stated->v)[static_cast<std::size_t>(i)];
  if (before.size() == 0) return fmt::format("{:.15g}", value);  // by momenta
  const bool moved = before[i] != value;
  return fmt::format("{:.15g}, {}{}", value, describe(origin),
                     moved ? fmt::format(", from {:.10g}", before[i]) : "");
}

std::vector<std::string> changes_of(const CatalogueScene& entry, const SolvedStart& solved) {
  std::vector<std::string> changes = entry.changes;
  for (const PlanLine& line : solved.prepared.lines)
    changes.push_back(fmt::format("{}: {} ({})", line.item, line.decision, line.reason));
  return changes;
}

std::string start_text(const CatalogueScene& entry, const SolvedStart& solved) {
  const Scene& scene = *solved.prepared.scene;
  const StatedStart* stated = entry.stated_start ? &*entry.stated_start : nullptr;
  const bool accelerated = solved.acceleration.size() > 0;
  std::vector<std::vector<std::string>> rows{{"coordinate", "q", "v", "p"}};
  if (accelerated) rows[0].emplace_back("dv/dt");
  const int shown = std::min(scene.dimension(), most_shown);
  if (scene.space) {  // more numbers of q than of v and p
    const std::vector<std::string> names = position_names(scene);
    for (int i = 0; i < std::min(scene.storage_size(), most_shown); ++i) {
      rows.push_back({names[static_cast<std::size_t>(i)], cell(solved.sample.q[i], stated, true, i), "", ""});
      if (accelerated) rows.back().emplace_back();
    }
  }
  for (int i = 0; i < shown; ++i) {
    rows.push_back({scene.coordinates[static_cast<std::size_t>(i)],
                    scene.space ? "" : cell(solved.sample.q[i], stated, true, i),
                    cell(solved.sample.v[i], stated, false, i), fmt::format("{:.15g}", solved.sample.p[i])});
    if (accelerated) rows.back().push_back(fmt::format("{:.15g}", solved.acceleration[i]));
  }
  std::string text = fmt::format("{} at t = {:.10g}\n\n{}", scene.name, scene.start.time, aligned(rows));
  if (shown < scene.dimension())
    text += fmt::format("… {} of {} coordinates left out; --json has them all\n", scene.dimension() - shown,
                        scene.dimension());
  const auto names = scene.row_names();
  const int forces = std::min(static_cast<int>(solved.sample.lambda.size()), most_shown);
  for (int r = 0; r < forces; ++r)
    text += fmt::format("force of row {}: {:.15g}\n", names[static_cast<std::size_t>(r)],
                        solved.sample.lambda[r]);
  text += fmt::format("energy: {:.15g}\n", solved.sample.energy);
  for (const std::string& change : changes_of(entry, solved)) text += change + '\n';
  return text;
}

Json origins_json(const std::vector<std::string>& names, const std::vector<StartOrigin>& origins) {
  Json json = Json::object();
  for (std::size_t i = 0; i < names.size(); ++i) add_member(json, names[i], describe(origins[i]));
  return json;
}

Json column_json(const std::vector<std::string>& names, const Vector& values) {
  Json json = Json::object();
  for (Eigen::Index i = 0; i < std::min(values.size(), static_cast<Eigen::Index>(names.size())); ++i)
    add_member(json, names[static_cast<std::size_t>(i)], Json(values[i]));
  return json;
}

std::string start_json(const CatalogueScene& entry, const SolvedStart& solved) {
  const Scene& scene = *solved.prepared.scene;
  Json json{{"scene", scene.name}, {"t", scene.start.time}};
  json["q"] = column_json(position_names(scene), solved.sample.q);
  json["v"] = column_json(scene.coordinates, solved.sample.v);
  json["p"] = column_json(scene.coordinates, solved.sample.p);
  json["acceleration"] =
      solved.acceleration.size() > 0 ? column_json(scene.coordinates, solved.acceleration) : Json(nullptr);
  json["lambda"] = column_json(scene.row_names(), solved.sample.lambda);
  json["energy"] = solved.sample.energy;
  if (entry.stated_start) {
    const StatedStart& stated = *entry.stated_start;
    json["given"] = {{"q", column_json(position_names(scene), stated.start.q)},
                     {"v", column_json(scene.coordinates, stated.start.v)},
                     {"p", column_json(scene.coordinates, stated.start.p)}};
    json["origin"] = {{"q", origins_json(position_names(scene), stated.q)},
                      {"v", origins_json(scene.coordinates, stated.v)}};
    json["moved"] = {
        {"q", (solved.sample.q - stated.start.q).norm()},
        {"v", stated.start.v.size() > 0 ? Json((solved.sample.v - stated.start.v).norm()) : Json(nullptr)}};
  }
  json["changes"] = changes_of(entry, solved);
  return to_text(json, 2) + '\n';
}

void start(const StartArguments& options, Session& session) {
  const CatalogueScene entry = make_scene(session, options.scene, parameters(options.set));
  const SolvedStart solved =
      solved_start(entry.scene, {.drop_redundant_rows = session.drop_redundant_rows}, session.solvers);
  print(options.json ? start_json(entry, solved) : start_text(entry, solved));
}

}  // namespace

void add_start(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "start", "The solved start: positions, velocities, momenta, accelerations, forces of rows");
  const auto options = std::make_shared<StartArguments>();
  verb->add_option("SCENE", options->scene, "A scene; see diracstep list scenes")->required();
  add_redundancy_option(*verb, session);
  add_set_option(*verb, options->set);
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer("Example:  diracstep start andrews_squeezer");
  verb->callback([options, &session] { start(*options, session); });
}

}  // namespace diracstep::command
