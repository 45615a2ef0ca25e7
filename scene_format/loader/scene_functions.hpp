#pragma once

#include <diracstep/core/system/scene.hpp>
#include <diracstep/scene_format/loader/loaded_scene.hpp>
#include <functional>
#include <memory>

namespace diracstep {

/// The functions of a loaded scene as the library takes them; null where the scene has none.
std::shared_ptr<const Lagrangian> file_lagrangian(const LoadedScenePtr& scene);
std::shared_ptr<const Hamiltonian> file_hamiltonian(const LoadedScenePtr& scene);
std::shared_ptr<const Force> file_force(const LoadedScenePtr& scene);
ConstraintBlocks file_constraints(const LoadedScenePtr& scene);

/// The value f(t, q, v or p) of a function of the scene's program without derivatives: an invariant or an
/// output.
using ValueFunction = std::function<double(double t, ConstVectorRef q, ConstVectorRef y)>;
ValueFunction file_value(const LoadedScenePtr& scene, const scene_compiler::SceneFunction& of);

}  // namespace diracstep
