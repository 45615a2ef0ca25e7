#pragma once

#include <diracstep/core/scene.hpp>
#include <diracstep/validation/scene_file/coordinate_layout.hpp>
#include <diracstep/validation/scene_file/kernel_library.hpp>
#include <functional>
#include <memory>

namespace diracstep {

/// A scene file with its parameters set: all that its functions share.
struct LoadedScene {
  static constexpr long most_instances = 20'000'000;  ///< of repeated elements, in all pieces of a function

  LoadedScene(std::unique_ptr<const scene_compiler::SceneProgram> compiled,
              scene_compiler::ParameterValues values);

  std::unique_ptr<const scene_compiler::SceneProgram> program;
  scene_compiler::ParameterValues parameters;
  CoordinateLayout layout;
  std::vector<double> known;  ///< subexpressions of the parameters alone
  KernelLibrary library;
};
using LoadedScenePtr = std::shared_ptr<const LoadedScene>;

/// The functions of a loaded scene as the library takes them; null where the scene has none.
std::shared_ptr<const Lagrangian> file_lagrangian(const LoadedScenePtr& scene);
std::shared_ptr<const Hamiltonian> file_hamiltonian(const LoadedScenePtr& scene);
std::shared_ptr<const Force> file_force(const LoadedScenePtr& scene);
ConstraintBlocks file_constraints(const LoadedScenePtr& scene);

/// The value of an invariant f(t, q, v or p).
using InvariantFunction = std::function<double(double t, ConstVectorRef q, ConstVectorRef y)>;
InvariantFunction file_invariant(const LoadedScenePtr& scene, std::size_t number);

/// Throws SceneError where a formula cannot be computed at the start, telling the operation and its place: a
/// division by zero, the logarithm of a negative number.
void require_defined(const LoadedScene& scene, const Scene& functions, double t, ConstVectorRef q,
                     ConstVectorRef v, ConstVectorRef p);

}  // namespace diracstep
