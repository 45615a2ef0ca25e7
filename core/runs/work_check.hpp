#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/path_cubic.hpp>
#include <string>

namespace diracstep {

/// Compares the energy of a run with the work  W = ∫ f·v dt  of the scene's forces.  What a method that damps
/// loses beside it, the method took: doubted where that exceeds a thousandth of the energies at play, the
/// larger of |p·v|/2 and the change of the energy, and five times the error of the quadrature.  With other
/// methods what is won or lost beside it is an error of the steps: doubted above a hundredth of the energies
/// at play and of ∫ |f·v| dt, which a motion that is driven and damped turns over; a tenth where the order is
/// below 3, whose energy swings about the true one.
///
/// The work of a step that crosses kinks is taken from kink to kink.  Behind a step divided at instants that
/// the time alone brings, as a pulse far shorter than it, which no cubic knows, the comparison begins anew.
///
/// Only for scenes in R^n that are given by a Lagrangian, with a force by which alone the energy changes: no
/// time in L, and rows that do no work.
class WorkCheck {
 public:
  /// The integrator's scene must outlive this.
  explicit WorkCheck(const Integrator& integrator);

  /// After each step.
  void after(const Integrator& integrator) {
    if (watched_) look(integrator);
  }
  /// Points of the run, the start first, at or after the last step.
  void see(const Sample& point);

  /// Empty, or a line that tells how far the energy is from the work.
  std::string text() const;

 private:
  /// W over a part of the motion, and how well it is known.
  struct Integral {
    double value = 0.0, error = 0.0;
  };
  bool doubted() const;
  void look(const Integrator& integrator);
  Integral work_between(const PathPoint& from, const PathPoint& to);
  double power(double t, const Vector& q, const Vector& v);

  const Scene& scene_;
  int order_;
  bool damped_, watched_, begun_ = false;
  PathPoint from_, to_;
  double power_ = 0.0;  ///< at to_
  Integral work_;
  double turned_over_ = 0.0;  ///< ∫ |f·v| dt, by steps
  Vector force_, q_, v_;
  double start_energy_ = 0.0, at_play_ = 0.0;
  double off_ = 0.0, off_by_ = 0.0;   ///< the most so far, quadrature errors deducted, and when
  double change_ = 0.0, done_ = 0.0;  ///< of the energy, and by the forces, until then
};

}  // namespace diracstep
