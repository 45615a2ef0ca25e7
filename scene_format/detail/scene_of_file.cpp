#include <algorithm>
#include <diracstep/core/system/on_space.hpp>
#include <diracstep/scene_format/detail/scene_of_file.hpp>
#include <diracstep/scene_format/loader/scene_functions.hpp>
#include <diracstep/scene_format/loader/scene_kinks.hpp>
#include <diracstep/scene_format/spaces/named_space.hpp>

namespace diracstep {

using namespace scene_compiler;

namespace {

/// By coordinate; empty where the file states none.
Vector tolerances_of(const LoadedScene& loaded) {
  const auto& coordinates = loaded.program->document.coordinates;
  const auto stated = [](const auto& coordinate) { return coordinate.tolerance != 0.0; };
  if (std::ranges::none_of(coordinates, stated)) return {};
  Vector tolerances = Vector::Zero(loaded.layout.dimension());
  for (std::size_t f = 0; f < coordinates.size(); ++f) {
    const int family = static_cast<int>(f);
    for (long i = 0; i < loaded.layout.count(family); ++i)
      tolerances[loaded.layout.position(family, loaded.layout.element(family, i))] = coordinates[f].tolerance;
  }
  return tolerances;
}

/// Kinks of functions of stored numbers, with the velocity of a space in place of as many.
class KinksOnSpace final : public Kinks {
 public:
  explicit KinksOnSpace(std::shared_ptr<const Kinks> of_numbers)
      : Kinks(of_numbers->kinds(), of_numbers->names()), of_numbers_(std::move(of_numbers)) {}

  void evaluate(double t, ConstVectorRef q, ConstVectorRef v, VectorRef g) const override {
    Vector whole = Vector::Zero(q.size());
    whole.head(v.size()) = v;
    of_numbers_->evaluate(t, q, whole, g);
  }
  std::vector<Instant> instants(double first, double last) const override {
    return of_numbers_->instants(first, last);
  }

 private:
  std::shared_ptr<const Kinks> of_numbers_;
};

/// The functions of stored numbers as those on the space.
void put_functions_on_space(const LoadedScene& loaded, Scene& scene) {
  scene.space = named_space(loaded.program->document.spaces.kinds);
  scene.coordinates = loaded.components();
  scene.lagrangian = on_space(scene.space, scene.lagrangian);
  for (auto& rows : scene.constraints) rows = on_space(scene.space, rows);
  if (scene.force) scene.force = on_space(scene.space, scene.force);
  if (scene.kinks) scene.kinks = std::make_shared<KinksOnSpace>(scene.kinks);
}

}  // namespace

Scene scene_of(const LoadedScenePtr& loaded, const Start& start) {
  Scene scene;
  scene.name = loaded->program->document.name;
  scene.coordinates = loaded->layout.names();
  scene.lagrangian = file_lagrangian(loaded);
  scene.hamiltonian = file_hamiltonian(loaded);
  scene.constraints = file_constraints(loaded);
  scene.force = file_force(loaded);
  scene.start = start;
  scene.kinks = file_kinks(loaded);
  scene.tolerances = tolerances_of(*loaded);
  if (!loaded->program->document.spaces.kinds.empty()) put_functions_on_space(*loaded, scene);
  return scene;
}

}  // namespace diracstep
