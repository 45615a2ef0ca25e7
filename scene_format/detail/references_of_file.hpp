#pragma once

#include <diracstep/scene_format/loader/loaded_scene.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <optional>
#include <vector>

namespace diracstep {

/// References for which the scene has the right parameters.
class References {
 public:
  explicit References(LoadedScenePtr loaded);

  std::vector<KnownState> at_stated_times() const;

  /// The first closed form, else nothing.
  std::optional<KnownState> closed_form(double t) const;

  Reference summary() const;

 private:
  const scene_compiler::SceneDocument::Reference& stated(std::size_t i) const;
  double start() const;

  /// A closed form holds for all parameters unless it names some; digits hold for those of the file.
  bool holds(const scene_compiler::SceneDocument::Reference& reference) const;

  KnownState state(std::size_t i, double t) const;

  /// The whole state, where the reference gives all of it.  Where L is linear in v the position is the state:
  /// p = ∂L/∂v(q), and v = 0 stands for a velocity that is not stated.
  std::optional<ReferencePoint> point(std::size_t i, double t) const;

  std::optional<ReferencePoint> at(double t) const;

  LoadedScenePtr loaded_;
  bool momentum_of_position_ = false;  ///< a Lagrangian linear in v
  std::vector<std::size_t> valid_;
};

}  // namespace diracstep
