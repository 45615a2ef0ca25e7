#include <cmath>
#include <diracstep/core/errors.hpp>
#include <diracstep/validation/scene_catalogue.hpp>
#include <diracstep/validation/scenes/scenes.hpp>
#include <sstream>

namespace diracstep {

namespace {

struct Entry {
  Parameters defaults;
  CatalogueScene (*make)(const Parameters&);
};

const std::map<std::string, Entry>& catalogue() {
  static const std::map<std::string, Entry> entries{
      {"kepler_e06", {{{"e", 0.6}}, scenes::kepler}},
      {"knife_edge", {{{"m", 1.0}, {"J", 1.0}, {"g_sin_alpha", 0.7173560908995228}}, scenes::knife_edge}},
      {"nonholonomic_particle_free", {{}, scenes::nonholonomic_particle_free}},
      {"pendulum_cartesian", {{{"g", 13.750371636040745}}, scenes::pendulum_cartesian}},
  };
  return entries;
}

template <class Map>
std::string keys(const Map& map) {
  if (map.empty()) return " none";
  std::string all;
  for (const auto& [key, value] : map) all += " " + key;
  return all;
}

}  // namespace

std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  for (const auto& [name, entry] : catalogue()) names.push_back(name);
  return names;
}

CatalogueScene make_scene(const std::string& name, const Parameters& changes) {
  const auto found = catalogue().find(name);
  if (found == catalogue().end())
    throw Misuse("unknown scene '" + name + "'; the scenes are" + keys(catalogue()));
  Parameters parameters = found->second.defaults;
  for (const auto& [key, value] : changes) {
    const auto parameter = parameters.find(key);
    if (parameter == parameters.end())
      throw Misuse("scene '" + name + "' has no parameter '" + key + "'; its parameters are" + keys(parameters));
    if (!std::isfinite(value)) {
      std::ostringstream message;
      message << "scene '" << name << "': parameter " << key << " = " << value << "; a finite number is needed";
      throw Misuse(message.str());
    }
    parameter->second = value;
  }
  CatalogueScene scene = found->second.make(parameters);
  scene.parameters = parameters;
  return scene;
}

}  // namespace diracstep
