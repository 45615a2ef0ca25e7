#pragma once

#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// A scene with parameters θ that its motion is differentiated by.
///
/// `extended` is the scene with θ as further coordinates, after its own: L(t, (q,θ), (v,v_θ)), rows and
/// forces alike.  Every derivative by θ is then one by a coordinate, which jets and the scene compiler give
/// exactly; only v_θ = 0 is ever looked at, and nothing is stepped in it.  Its Lagrangian may hold Σ v_θ²/2,
/// and must where the method needs a Hamiltonian; one in p then holds Σ p_θ²/2.  A row of `extended` acts on
/// the scene's own velocities alone, a force on the scene's own coordinates.
struct ParametricScene {
  std::shared_ptr<const Scene> scene;     ///< the one that is stepped, of n coordinates
  std::shared_ptr<const Scene> extended;  ///< of n + P coordinates; null where P = 0
  Vector parameters = {};                 ///< θ, P numbers
  Columns start_q = {}, start_v = {};  ///< ∂q0/∂θ and ∂v0/∂θ, n×P; empty: the start does not depend on θ

  /// Empty, or what the derivatives lack: the formulas switch where a parameter says.
  std::string doubt = {};

  /// The names of the parameters.
  std::vector<std::string> names() const;
};

/// Throws Misuse where the sizes of the two scenes disagree, or their rows.
void require_well_formed(const ParametricScene& scene);

}  // namespace diracstep
