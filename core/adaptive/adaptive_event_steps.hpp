#pragma once

#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/runs/event_steps.hpp>

namespace diracstep::detail {

/// For EventSteps<AdaptiveIntegrator>.
template <>
struct Stepping<AdaptiveIntegrator> {
  static constexpr bool on_a_grid = false;
  static const Integrator& integrator(const AdaptiveIntegrator& stepper) { return stepper.integrator(); }
  static double size(const AdaptiveIntegrator& stepper) { return stepper.next_size(); }
  static StepReport step(AdaptiveIntegrator& stepper, double) { return stepper.step(); }
  static StepReport read(AdaptiveIntegrator& stepper, const Node& from, double t, Momentum momentum,
                         Sample& sample) {
    return stepper.sample_from(from.time, from.q, from.p, from.v, t, momentum, sample);
  }
};

}  // namespace diracstep::detail
