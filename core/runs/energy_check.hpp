#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/runs/rest_sizes.hpp>
#include <string>

namespace diracstep {

/// Whether the formulas show that the energy is a constant of the scene's motion: no force, no time in L or H
/// (PhaseStructure::autonomous), and rows that do no work (ConstraintRows::workless).  False where that is
/// not known.  Needs a completed scene, as Integrator::scene() is.
bool keeps_energy(const Scene& scene);

/// Follows the energy along a run, to say when its points are not to be believed: the scene keeps its energy,
/// and a point is off by more than a tenth of the energies at play there, the larger of
///
///   |p·v|/2  and  |∂L/∂q·(q − q(start))|,
///
/// of methods that damp the former alone, since forces that are large for a moment lose no energy of theirs;
/// the start is the first point seen: neither depends on where coordinates or energies count from.
/// They are measured by their mean over all points up to one, since a run that blows up has large ones at its
/// end, from the 32nd point on; where fewer were seen, by the largest of all.  Methods of order 1 are off by
/// 1/k of the kinetic energy k steps after a start from rest.
///
/// Points that have not moved from the start are not looked at, and changes by the round-off of the energy,
/// or of what forces in balance would do between two points seen (RestSizes), are none.  No method here
/// changes the energy so much at a step that resolves the motion.  Silence proves nothing: an energy can be
/// kept on a wrong path.
class EnergyCheck {
 public:
  /// The scene, a completed one, must outlive this.  Where the method damps what is too fast for its
  /// steps, the line says of lost energy that it is the method's doing and not the scene's.
  explicit EnergyCheck(const Scene& scene, bool damped = false);

  void see(const Sample& point);

  /// Empty, or a line that names the worst point so far.
  std::string text() const;

  /// Empty, or a line that says that a point cannot have so small an error: relative errors e of q and p,
  /// in parts of the sizes Q and P, change the energy by no more than
  ///
  ///   e (P Σ |v_i| + Q Σ |∂L/∂q_i|)
  ///
  /// to first order; doubted above twice that and the round-off of the energy.
  std::string denied(const Sample& point, double error, double position_size, double momentum_size);

 private:
  void add_at_play(const Sample& point);
  /// Beside such energies at play; a change by the round-off of the energy itself is none.
  bool too_large(double at_play) const;
  double mean_at_play() const { return sum_at_play_ / static_cast<double>(points_); }

  const Scene& scene_;
  bool keeps_energy_, damped_;
  RestSizes rest_;
  Vector force_, momentum_;
  Vector start_position_;  ///< empty before the first point
  double start_energy_ = 0.0, last_time_ = 0.0, longest_time_ = 0.0;
  double at_play_ = 0.0;  ///< the largest so far
  double sum_at_play_ = 0.0;
  long points_ = 0;
  bool lost_ = false;  ///< at a point seen, from the 32nd on
  double worst_change_ = 0.0, worst_energy_ = 0.0, worst_time_ = 0.0;
};

}  // namespace diracstep
