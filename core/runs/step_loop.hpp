#pragma once

#include <diracstep/core/integrator/integrator.hpp>

namespace diracstep {

/// The loop of every run, for an Integrator or an AdaptiveIntegrator: steps as long as `goes_on(k)` says so
/// with k steps taken here, and calls `after(k)` after each, which ends the run by false.  The report of the
/// last step, which may have failed.
template <class Stepper, class GoesOn, class After>
StepReport step_while(Stepper& stepper, GoesOn goes_on, After after) {
  StepReport last;
  for (long k = 0; goes_on(k);) {
    last = stepper.step();
    if (!last.ok() || !after(++k)) break;
  }
  return last;
}

/// Up to `steps` steps, and nothing else.
template <class Stepper>
StepReport take_steps(Stepper& stepper, long steps) {
  return step_while(
      stepper, [steps](long k) { return k < steps; }, [](long) { return true; });
}

}  // namespace diracstep
