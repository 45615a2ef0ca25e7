#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/runs/path_cubic.hpp>
#include <string>

namespace diracstep {

/// Compares the energy of a run with a method that damps with the work  W = ∫ f·v dt  of the scene's forces:
/// what is lost beside it, the method took.  Doubted where that exceeds a thousandth of the energies at play,
/// the larger of |p·v|/2 and the change of the energy, and five times the error of the quadrature.
///
/// Only for scenes with a force whose energy changes by it alone: no time in L, and rows that do no work.
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

  /// Empty, or a line that tells what the method took.
  std::string text() const;

 private:
  /// W over a part of the motion, and how well it is known.
  struct Integral {
    double value = 0.0, error = 0.0;
  };
  void look(const Integrator& integrator);
  Integral work_between(const PathPoint& from, const PathPoint& to);
  double power(double t, const Vector& q, const Vector& v);

  const Scene& scene_;
  bool watched_, begun_ = false;
  PathPoint from_, to_;
  Integral work_;
  Vector force_, q_, v_;
  double start_energy_ = 0.0, at_play_ = 0.0;
  double taken_ = 0.0, taken_by_ = 0.0;  ///< the most so far, quadrature errors deducted, and when
};

}  // namespace diracstep
