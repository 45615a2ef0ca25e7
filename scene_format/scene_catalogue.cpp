#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/loader/shipped_scenes.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/scene_format/scene_file.hpp>

namespace diracstep {

std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  for (const ShippedScene& scene : shipped_scenes()) names.emplace_back(scene.name);
  return names;
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
  throw Misuse("unknown scene '" + name + "'; the scenes are" + known +
               "; or give the path of a file NAME.toml");
}

}  // namespace diracstep
