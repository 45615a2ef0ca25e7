#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/near_names.hpp>
#include <diracstep/core/system/redundant_rows.hpp>
#include <diracstep/scene_format/loader/shipped_scenes.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/scene_format/scene_file.hpp>

namespace diracstep {

std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  for (const ShippedScene& scene : shipped_scenes()) names.emplace_back(scene.name);
  return names;
}

void drop_redundant_rows(CatalogueScene& entry) {
  const std::shared_ptr<const Scene> scene = completed(entry.scene);
  if (!scene->start.q.allFinite() || scene->start.q.size() != scene->dimension()) return;  // refused by runs
  const std::vector<std::string> dependent = redundant_rows(*scene, scene->start);
  if (dependent.empty() || row_dependence(*scene, scene->start, dependent) != RowDependence::lasting) return;
  entry.scene = without_rows(*entry.scene, dependent);
  std::string names;
  for (const std::string& name : dependent) names += (names.empty() ? "'" : ", '") + name + "'";
  entry.changes.push_back("redundant constraints left out: " + names);
}

CatalogueScene make_scene(const std::string& name, const Parameters& changes) {
  if (name.ends_with(".toml")) return scene_from_file(name, changes);
  std::string known;
  for (const ShippedScene& scene : shipped_scenes()) {
    if (scene.name == name)
      return scene_from_text(name, std::string(reinterpret_cast<const char*>(scene.text), scene.size),
                             changes);
    known += std::string(" ") + scene.name;
  }
  throw Misuse("unknown scene '" + name + "'" + did_you_mean(name, scene_names()) + "; the scenes are" +
               known + "; or give the path of a file NAME.toml");
}

}  // namespace diracstep
