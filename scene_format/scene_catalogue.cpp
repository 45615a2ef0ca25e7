#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/names.hpp>
#include <diracstep/core/system/contradictory_rows.hpp>
#include <diracstep/core/system/redundant_rows.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/scene_format/compiler/plain_scene.hpp>
#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <diracstep/scene_format/loader/shipped_scenes.hpp>
#include <diracstep/scene_format/parametric_scene_file.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/scene_format/scene_text.hpp>

namespace diracstep {

std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  for (const ShippedScene& scene : shipped_scenes()) names.emplace_back(scene.name);
  return names;
}

void require_inputs_until(const CatalogueScene& entry, double end, const std::string& what) {
  for (const auto& [name, first, last] : entry.input_ranges)
    if (!(end >= first && end <= last))
      throw Misuse(what + ": the input '" + name + "' is given from t = " + to_text(first) + " to " +
                   to_text(last) + " and has no value at t = " + to_text(end) +
                   "; hold = true would keep its end values");
}

namespace {

std::shared_ptr<const Scene> without_refusal(const std::shared_ptr<const Scene>& scene) {
  if (!scene || !scene->refuse_redundant_rows) return scene;
  auto copy = std::make_shared<Scene>(*scene);
  copy->refuse_redundant_rows = false;
  return copy;
}

}  // namespace

void drop_redundant_rows(CatalogueScene& entry) {
  entry.scene = without_refusal(entry.scene);
  entry.all_rows = without_refusal(entry.all_rows);
  const std::shared_ptr<const Scene> scene = completed(entry.scene);
  if (!scene->start.q.allFinite() || scene->start.q.size() != scene->storage_size())
    return;  // refused by runs
  const std::vector<std::string> dependent = redundant_rows(*scene, scene->start);
  if (dependent.empty() || row_dependence(*scene, scene->start, dependent) != RowDependence::lasting) return;
  if (!contradiction(*scene, scene->start, dependent).empty()) return;  // refused by runs, with the reason
  if (entry.events.empty()) {
    entry.all_rows = entry.scene;
    entry.scene = with_rows_left_out(entry.scene, dependent);
  }
  entry.changes.push_back("redundant constraints left out: " + name_list(dependent) +
                          "; forces of rows are the least ones that act as theirs do");
}

Vector shown_forces(const CatalogueScene& entry, double t, const Vector& q, const Vector& lambda) {
  return entry.events.empty() ? forces_of_whole(*entry.scene, t, q, lambda) : lambda;
}

void set_tolerances(CatalogueScene& entry, const Parameters& tolerances) {
  if (tolerances.empty()) return;
  require_flat(*entry.scene, "a tolerance of a coordinate");
  auto scene = std::make_shared<Scene>(*entry.scene);
  if (scene->tolerances.size() == 0) scene->tolerances.setZero(scene->dimension());
  for (const auto& [name, tolerance] : tolerances) {
    const auto found = std::ranges::find(scene->coordinates, name);
    if (found == scene->coordinates.end())
      throw Misuse("tolerance: scene '" + scene->name + "' has no coordinate '" + name + "'" +
                   did_you_mean(name, scene->coordinates));
    if (!(tolerance > 0.0 && tolerance < HUGE_VAL))
      throw Misuse("tolerance: " + to_text(tolerance) + " for '" + name + "'; a number above 0 is needed");
    scene->tolerances[found - scene->coordinates.begin()] = tolerance;
  }
  entry.scene = std::move(scene);
}

std::string scene_text(const std::string& name) {
  if (is_scene_file(name)) return read_file(name, "the scene file", scene_compiler::size_limits().file_bytes);
  std::string known;
  for (const ShippedScene& scene : shipped_scenes()) {
    if (scene.name == name) return {reinterpret_cast<const char*>(scene.text), scene.size};
    known += std::string(" ") + scene.name;
  }
  throw Misuse("unknown scene '" + name + "'" + did_you_mean(name, scene_names()) + "; the scenes are" +
               known + "; or give the path of a file NAME.toml or NAME.cir");
}

CatalogueScene make_scene(const std::string& name, const Parameters& changes) {
  return scene_source(name).load(changes);
}

std::string expanded_scene(const std::string& name) {
  return scene_compiler::plain_scene(name, scene_text(name));
}

SceneFile scene_source(const std::string& name) { return {name, scene_text(name)}; }

ParametricScene parametric_scene(const std::string& name, const CatalogueScene& entry,
                                 const std::vector<std::string>& parameters, const Parameters& changes) {
  if (parameters.empty()) return {entry.scene, nullptr};
  if (!entry.stated_start)
    throw Misuse("scene '" + name + "' is not from a file: it has no parameters to be differentiated by");
  return parametric_scene_from_text(name, scene_text(name), entry, parameters, changes);
}

SceneControl scene_control(const std::string& name, const CatalogueScene& entry, const Parameters& changes) {
  if (!entry.stated_start) throw Misuse("scene '" + name + "' is not from a file: it has no [control]");
  return scene_control_from_text(name, scene_text(name), entry, changes);
}

}  // namespace diracstep
