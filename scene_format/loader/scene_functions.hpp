#pragma once

#include <diracstep/core/system/motion_point.hpp>
#include <diracstep/core/system/scene.hpp>
#include <diracstep/scene_format/loader/loaded_scene.hpp>
#include <functional>
#include <memory>

namespace diracstep {

/// The functions of a loaded scene as the library takes them; null where the scene has none.
std::shared_ptr<const Lagrangian> file_lagrangian(const LoadedScenePtr& scene);
std::shared_ptr<const Hamiltonian> file_hamiltonian(const LoadedScenePtr& scene);
std::shared_ptr<const Lagrangian> file_cost(const LoadedScenePtr& scene);
std::shared_ptr<const Lagrangian> file_end_cost(const LoadedScenePtr& scene);
std::shared_ptr<const Force> file_force(const LoadedScenePtr& scene);
ConstraintBlocks file_constraints(const LoadedScenePtr& scene);

/// The value f(t, q, v or p) of a function of the scene's program without derivatives: an invariant or an
/// output.
using ValueFunction = std::function<double(double t, ConstVectorRef q, ConstVectorRef y)>;
ValueFunction file_value(const LoadedScenePtr& scene, const scene_compiler::SceneFunction& of);
/// The same of all that a point of a motion has, its forces being those of rows of these names; rows that are
/// not among them have none.
PointFunction file_point_value(const LoadedScenePtr& scene, const scene_compiler::SceneFunction& of,
                               const std::vector<std::string>& rows);
/// A function of rows as constraints.
std::shared_ptr<const ConstraintRows> file_rows(const LoadedScenePtr& scene,
                                                const scene_compiler::SceneFunction& of);

}  // namespace diracstep
