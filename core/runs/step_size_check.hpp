#pragma once

#include <cmath>
#include <diracstep/core/integrator/integrator.hpp>
#include <string>

namespace diracstep {

/// Halves a few steps of a run, one in 600 and at least three, to say when they are too large: at a step that
/// resolves the motion, two halves end where the whole does.  The difference d of the ends is measured by the
/// longest way that such a step went so far,
///
///   d = |q1(h) − q1(h/2, h/2)|∞ / max h |v|∞,
///
/// (of a scene at rest by 1e-12 |q|∞), and doubted above a quarter: methods of order 1 stay below at h times
/// the rate of the motion of 1, the others at more.  Needs no energy, so that it also sees forced and driven
/// scenes.  The halves are taken between Integrator::save and restore: the run keeps its bits.  Silence
/// proves nothing: a short event between the looks is not seen.
class StepSizeCheck {
 public:
  /// For the next so many steps.
  StepSizeCheck(const Integrator& integrator, long steps);

  /// Around each step of the run; for most of them a comparison of numbers.
  void before(Integrator& integrator) {
    if (integrator.work().steps == next_look_) halve(integrator);
  }
  void after(const Integrator& integrator) {
    if (halved_) compare(integrator);
  }

  /// Empty, or a line that names the worst step so far.
  const std::string& text() const { return text_; }
  /// The largest d so far; NaN before the first.
  double worst() const { return worst_; }

 private:
  void halve(Integrator& integrator);
  void compare(const Integrator& integrator);

  long between_looks_, next_look_;
  bool halved_ = false;
  double start_time_ = 0.0, longest_way_ = 0.0, worst_ = std::nan("");
  Vector start_, end_of_halves_;
  std::string text_;
};

}  // namespace diracstep
