#include <fmt/format.h>

#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/scene_format/spaces/factor_texts.hpp>

namespace diracstep {

namespace {

std::vector<std::string> numbered(int count) {
  std::vector<std::string> names;
  for (int i = 1; i <= count; ++i) names.push_back(fmt::format("q_{}", i));
  return names;
}

/// "SO3", "R3" of "SO3 x R3".
std::vector<std::string> factors_of(const std::string& space) {
  const std::string between = " x ";
  std::vector<std::string> kinds;
  for (std::size_t at = 0; at != std::string::npos;) {
    const std::size_t end = space.find(between, at);
    kinds.push_back(space.substr(at, end == std::string::npos ? end : end - at));
    at = end == std::string::npos ? end : end + between.size();
  }
  return kinds;
}

}  // namespace

std::vector<std::string> position_names(const Scene& scene) {
  if (!scene.space) return scene.coordinates;
  std::vector<std::string> names;
  auto component = scene.coordinates.begin();
  for (const std::string& kind : factors_of(scene.space->name())) {
    if (!spaces::is_factor(kind)) return numbered(scene.storage_size());
    const auto [stored, components] = spaces::factor_sizes(kind);
    if (scene.coordinates.end() - component < static_cast<std::ptrdiff_t>(components))
      return numbered(scene.storage_size());
    const std::vector<std::string> own(component, component + static_cast<std::ptrdiff_t>(components));
    component += static_cast<std::ptrdiff_t>(components);
    if (kind[0] == 'R') {
      names.insert(names.end(), own.begin(), own.end());
      continue;
    }
    const std::string& first = own.front();
    const auto texts =
        spaces::factor_texts(kind, first.substr(0, first.size() - std::min<std::size_t>(2, first.size())));
    if (texts.components != own) return numbered(scene.storage_size());
    names.insert(names.end(), texts.stored.begin(), texts.stored.end());
  }
  return names;
}

const char* describe(StartOrigin origin) {
  switch (origin) {
    case StartOrigin::given:
      return "given";
    case StartOrigin::guess:
      return "guess";
    case StartOrigin::rate:
      return "rate";
    default:
      return "left out";
  }
}

void require_flat(const Scene& scene, const std::string& what) {
  if (scene.space)
    throw Misuse(fmt::format("scene '{}' is on {}: {} knows scenes in R^n only", scene.name,
                             scene.space->name(), what));
}

}  // namespace diracstep
