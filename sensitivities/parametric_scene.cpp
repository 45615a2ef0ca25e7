#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/sensitivities/parametric_scene.hpp>

namespace diracstep {

std::vector<std::string> ParametricScene::names() const {
  if (!extended) return {};
  return {extended->coordinates.begin() + scene->dimension(), extended->coordinates.end()};
}

void require_well_formed(const ParametricScene& given) {
  if (!given.scene) throw Misuse("a parametric scene without a scene");
  const std::string of = "scene '" + given.scene->name + "' with parameters: ";
  const auto parameters = given.parameters.size();
  const int n = given.scene->dimension();
  if (!given.extended) {
    if (parameters > 0) throw Misuse(of + "parameters, but no scene that has them as coordinates");
    return;
  }
  if (given.extended->dimension() != n + parameters)
    throw Misuse(of + std::to_string(given.extended->dimension()) + " coordinates; the scene has " +
                 std::to_string(n) + " and there are " + std::to_string(parameters) + " parameters");
  for (const Columns* start : {&given.start_q, &given.start_v})
    if (start->size() > 0 && (start->rows() != n || start->cols() != parameters))
      throw Misuse(of + "the derivatives of the start have the wrong size");
}

}  // namespace diracstep
