#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/runs/step_comparison.hpp>
#include <string>

namespace diracstep {

/// Divides a few steps of a run, one in 600 and at least three, to say when they are too large: at a step
/// that resolves the motion, two parts end where the whole does; see StepComparison.
///
/// Needs no energy, so that it also sees forced and driven scenes.  The parts are taken between
/// Integrator::save and restore: the run keeps its bits.  Silence proves nothing: a short event between the
/// looks is not seen.
class StepSizeCheck {
 public:
  /// For the next so many steps.
  StepSizeCheck(const Integrator& integrator, long steps);

  /// Around each step of the run; for most of them a comparison of numbers.
  void before(Integrator& integrator) {
    if (integrator.work().steps == next_look_) divide(integrator);
  }
  void after(Integrator& integrator) {
    if (divided_) compare(integrator);
  }

  /// Empty, or a line that names the worst step so far.
  std::string text() const { return comparison_.text(); }
  /// The largest difference of positions so far; NaN before the first.
  double worst() const { return comparison_.worst(); }

 private:
  void divide(Integrator& integrator);
  void compare(Integrator& integrator);

  StepComparison comparison_;
  long between_looks_, next_look_;
  bool divided_ = false;
  Sample start_, whole_, parts_;
};

}  // namespace diracstep
