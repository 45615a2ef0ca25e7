#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/runs/step_comparison.hpp>
#include <limits>
#include <string>
#include <vector>

namespace diracstep {

/// Divides a few steps of a run, one in 600 and at least three, the first one where it does not start from
/// rest, each that follows one in which the velocity changed by more than twice as much as ever before, and
/// what is left of a step behind a kink that it crossed, where a force may be another one, of the first three
/// such steps, the sixth, the twelfth, …, to say when they are too large: at a step that resolves the motion,
/// two parts end where the whole does; see StepComparison.  The step behind one at whose kinks is looked is
/// looked at too.  Where the steps at kinks are far worse than others, and as many as the run took would be
/// off by more than 2e-4 of the motion, forces act behind kinks that its steps are too long for, as contacts
/// of a few steps.
///
/// A run of at most 2000 steps and 12 coordinates and rows that crosses kinks in q or v, or is doubted for
/// those that its steps are not divided at, is repeated from its
/// start with about 0.62 of the step: how far apart both end, divided by 1 − 0.62^p, is its error to first
/// order, in parts of the way and of the largest momentum.  Doubted above 1e-3, of order 2 above 1e-2, of
/// order 1 above 0.1; below, what steps at kinks and parts of them differ by counts for nothing.  Behind a
/// kink a motion is another one, with other rates, of which the step before tells nothing.
///
/// Needs no energy, so that it also sees forced and driven scenes.  The parts are taken between
/// Integrator::save and restore: the run keeps its bits.  Silence proves nothing: a short event between the
/// looks is not seen.
class StepSizeCheck {
 public:
  /// For the next so many steps.  `repeats`: these depend on where they start alone, and on no force that is
  /// changed between them.
  StepSizeCheck(const Integrator& integrator, long steps, bool repeats = false);

  /// Around each step of the run; for most of them a comparison of numbers.  What the integrator tells of the
  /// last step, its kinks and stages, stays until before(): what is left behind its kinks is looked at there.
  void before(Integrator& integrator) {
    const bool behind_kinks = !kinks_.empty();
    if (behind_kinks) look_behind_kinks(integrator);
    const bool due = integrator.work().steps == next_look_;
    if (due) next_look_ += between_looks_;
    place_ = behind_kinks ? StepComparison::Place::at_kink
             : due        ? StepComparison::Place::usual
                          : StepComparison::Place::fast;
    if (due || velocity_.fast() || behind_kinks) divide(integrator);
    if (repeats_ && taken_ == 0) start_of_run_ = integrator.save();
  }
  void after(Integrator& integrator) {
    ++taken_;
    unresolved_ += integrator.unresolved_between_kinks();
    if (divided_) compare(integrator);
    velocity_.see(integrator.velocity_estimate());
    if (!integrator.kinks_passed().empty()) keep_kinks(integrator);
  }
  /// Points of the run, the start first.
  void see(const Sample& point);
  /// Behind the last step; `doubted` for steps over kinks that they were not divided at.
  void finish(Integrator& integrator, bool doubted) {
    if (!kinks_.empty()) look_behind_kinks(integrator);
    if (repeats_ && (over_kinks_ > 0 || doubted)) repeat(integrator);
  }

  /// Empty, or a line that names the worst step so far.
  std::string text() const;
  /// Whether the run was repeated and the other one ends where it does.
  bool confirmed() const { return error_ <= StepComparison::largest_error(order_); }
  /// The largest difference of positions so far; NaN before the first.
  double worst() const { return comparison_.worst(); }
  double part_of_motion() const { return comparison_.part_of_motion(); }

 private:
  void divide(Integrator& integrator);
  void compare(Integrator& integrator);
  void keep_kinks(Integrator& integrator);
  void look_behind_kinks(Integrator& integrator);
  void repeat(Integrator& integrator);

  StepComparison comparison_;
  long between_looks_, next_look_;
  bool divided_ = false;
  VelocityChanges velocity_;
  long over_kinks_ = 0, next_over_kinks_ = 1;  ///< steps that crossed some
  long looks_at_kinks_ = 0;
  StepComparison::Place place_ = StepComparison::Place::usual;  ///< of the step looked at
  std::vector<KinkPassed> kinks_;  ///< of the last step, where they are looked at
  Sample end_;                     ///< of that step
  Sample start_, whole_, parts_;
  int order_;
  bool repeats_;
  long wanted_, taken_ = 0, taken_before_;  ///< steps
  Snapshot start_of_run_;
  Vector first_;  ///< where the run starts
  double way_ = 0.0, largest_momentum_ = 0.0;
  double unresolved_ =
      0.0;  ///< between kinks of one step, added up: finer steps cut that into the same parts
  double error_ = std::numeric_limits<double>::quiet_NaN();  ///< by the run of finer steps
};

}  // namespace diracstep
