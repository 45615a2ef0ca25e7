#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <string>

namespace diracstep {

/// Whether the energy is a constant of the scene's motion: no force, no time in L, no driven rows (as far as
/// the start shows).  Needs a scene with a Lagrangian, as Integrator::scene() is.
bool keeps_energy(const Scene& scene);

/// Follows the energy along a run, to say when its points are not to be believed: the scene keeps its energy,
/// and a point is off by more than a tenth of the energies at play,
///
///   max(|E(start)|, min |p·v|/2, min |q|∞ |∂L/∂q|∞),   the smaller value at the start and at the point,
///
/// where the start is the first point seen.  Points that have not moved from there are not looked at.
/// No method here changes the energy so much at a step that resolves the motion.  Silence proves nothing: an
/// energy can be kept on a wrong path.
class EnergyCheck {
 public:
  /// The scene, one with a Lagrangian, must outlive this.
  explicit EnergyCheck(const Scene& scene);

  void see(const Sample& point);

  /// Empty, or a line that names the worst point so far.
  const std::string& text() const { return text_; }

 private:
  /// Energies at play at a point: |p·v|/2 and |q|∞ |∂L/∂q|∞.
  struct Sizes {
    double kinetic, work;
  };
  Sizes sizes(double t, ConstVectorRef q, ConstVectorRef v);

  const Scene& scene_;
  bool keeps_energy_;
  Vector force_, momentum_;
  Vector start_position_;  ///< empty before the first point
  double start_energy_ = 0.0;
  Sizes start_sizes_{0.0, 0.0};
  double worst_ = 0.1;  ///< change over size at the worst point; up to a tenth is no doubt
  std::string text_;
};

}  // namespace diracstep
