#pragma once

#include <cmath>
#include <diracstep/core/integrator/integrator.hpp>
#include <functional>
#include <vector>

namespace diracstep {

/// Part of a motion that is stepped evenly.
struct Stretch {
  double begin = 0.0, end = 0.0;
  long steps = 1;  ///< of the coarsest run
};

/// The whole motion, divided where the time alone makes a function of the scene switch, as far as its
/// formulas show (Scene::kinks).
std::vector<Stretch> known_stretches(const Scene& scene, double end);

/// How a motion is divided into steps of given size: nodes that every run has, where forces switch or change
/// fast, and between them a number of even steps that rises from run to run by one factor for all stretches,
/// so that the runs have an order.
///
/// Between two stretches a gap of a few units of round-off in t may lie, at an instant where a force jumps:
/// no step then reads the force on both of its sides, and its impulse there is that of the mean of both.
class StepPlan {
 public:
  StepPlan() = default;
  /// One stretch, with steps of about `step`, without sign.
  StepPlan(double start, double end, double step) : StepPlan(std::vector<Stretch>{{start, end}}, step) {}
  /// The stretches, in order; their numbers of steps are set here.
  StepPlan(std::vector<Stretch> stretches, double step);

  const std::vector<Stretch>& stretches() const { return stretches_; }
  bool even() const { return stretches_.size() == 1; }
  long steps() const { return steps_; }  ///< of the coarsest run
  /// The first step of a run, with its sign.
  double first_step(long refinement) const { return step_in(stretches_.front(), refinement); }
  /// The mean step of a run, with its sign.
  double mean_step(long refinement) const;

  /// Of Integrator::unresolved_between_kinks().
  void allow_unresolved(double part) { unresolved_allowed_ = part; }

  /// Steps through the motion; `at_kink` is called where a step has passed a kink in q or v, `at_node` after
  /// each step, and both end the run with false.  Fails where a step crosses a kink again and again,
  /// or leaves more unresolved between its kinks than is allowed.
  StepReport run(Integrator& integrator, long refinement, const std::function<bool()>& at_node,
                 const std::function<bool(const KinkPassed&)>& at_kink) const;

 private:
  static double step_in(const Stretch& stretch, long refinement) {
    return (stretch.end - stretch.begin) / static_cast<double>(stretch.steps * refinement);
  }

  std::vector<Stretch> stretches_;
  long steps_ = 0;
  double unresolved_allowed_ = HUGE_VAL;
};

}  // namespace diracstep
