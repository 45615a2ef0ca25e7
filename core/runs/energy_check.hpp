#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <string>

namespace diracstep {

/// Whether the formulas show that the energy is a constant of the scene's motion: no force, no time in L
/// (PhaseStructure::autonomous), and rows that do no work (ConstraintRows::workless).  False where that is
/// not known.  Needs a scene with a Lagrangian, as Integrator::scene() is.
bool keeps_energy(const Scene& scene);

/// Follows the energy along a run, to say when its points are not to be believed: the scene keeps its energy,
/// and a point is off by more than a tenth of the energies at play,
///
///   max |p·v|/2  and  max |∂L/∂q·(q − q(start))|   over the points of the run,
///
/// where the start is the first point seen: neither depends on where coordinates or energies count from.
/// Points that have not moved from there are not looked at.  No method here changes the energy so much at a
/// step that resolves the motion.  Silence proves nothing: an energy can be kept on a wrong path.
class EnergyCheck {
 public:
  /// The scene, one with a Lagrangian, must outlive this.
  explicit EnergyCheck(const Scene& scene);

  void see(const Sample& point);

  /// Empty, or a line that names the worst point so far.
  std::string text() const;

 private:
  const Scene& scene_;
  bool keeps_energy_;
  Vector force_, momentum_;
  Vector start_position_;  ///< empty before the first point
  double start_energy_ = 0.0;
  double at_play_ = 0.0;
  double worst_change_ = 0.0, worst_energy_ = 0.0, worst_time_ = 0.0;
};

}  // namespace diracstep
