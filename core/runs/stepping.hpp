#pragma once

#include <diracstep/core/integrator/integrator.hpp>

namespace diracstep::detail {

/// Where a step starts.
struct Node {
  double time;
  Vector q, p, v;
};

/// What EventSteps needs of a stepper.
template <class Stepper>
struct Stepping;

template <>
struct Stepping<Integrator> {
  static constexpr bool on_a_grid = true;
  static const Integrator& integrator(const Integrator& stepper) { return stepper; }
  static double size(const Integrator& stepper) { return stepper.options().step; }
  static StepReport step_to(Integrator& stepper, double t) { return stepper.step(t - stepper.time()); }
  static StepReport step(Integrator& stepper, double size) { return stepper.step(size); }
  /// The motion at a time behind a node, by a step of another integrator of the same scene.
  static StepReport read(Integrator& beside, const Node& from, double t, Momentum momentum, Sample& sample) {
    beside.restart(from.time, from.q, from.p, from.v);
    StepReport report;
    if (t != from.time) report = beside.step(t - from.time);
    if (report.ok()) report.solve = beside.sample(momentum, sample);
    sample.time = t;
    return report;
  }
};

}  // namespace diracstep::detail
