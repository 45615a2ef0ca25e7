#pragma once

#include <cmath>
#include <diracstep/core/integrator/sample.hpp>
#include <diracstep/core/system/scene.hpp>

namespace diracstep {

/// What may cancel within ∂L/∂q + f at a point, as of springs in balance: by coordinate the sum of the sizes
/// of their derivatives times positions and velocities, of which the sum of all forces may be round-off.
Vector cancelling_forces(const Scene& scene, const Sample& point);

/// What the forces of a scene would do in a time, were they not balanced: a scene at rest moves by the
/// round-off of this, also where its coordinates are zero.
class RestSizes {
 public:
  /// The scene, a completed one, must outlive this.
  explicit RestSizes(const Scene& scene);

  /// Reads the forces ∂L/∂q + f, with what cancels within them, and the masses ∂²L/∂v_i² at a point; −∂H/∂q +
  /// f and 1/m = ∂²H/∂p_i² where the scene is given by a Hamiltonian alone.
  void see(const Sample& point);
  /// max h |F_i|/m_i over the coordinates with a mass, and of these max h |F_i|.
  double speed(double h) const { return std::abs(h) * speed_; }
  double momentum(double h) const { return std::abs(h) * largest_force_; }
  /// Σ (h F_i)²/m_i
  double energy(double h) const { return h * h * energy_; }

 private:
  const Scene& scene_;
  Vector force_, momentum_, own_;
  double speed_ = 0.0, energy_ = 0.0, largest_force_ = 0.0;
};

}  // namespace diracstep
