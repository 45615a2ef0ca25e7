#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <functional>

namespace diracstep {

/// Called at kept points; returning false ends the run there.
using Observer = std::function<bool(const Sample&)>;

/// What a run did; `failure` is empty or says why it stopped early.  What was observed before stays valid.
struct [[nodiscard]] RunReport {
  StepReport last;
  bool ok() const { return last.ok(); }
};

/// Takes `steps` steps and shows the start, every `every`-th point and the last one to the observer, where
/// there is one.  A `doubt`, made for as many steps, sees the same points and every step; its text() then
/// says why the result is not to be believed, or nothing.
RunReport run(Integrator& integrator, long steps, Momentum momentum, long every, const Observer& observer,
              RunChecks* doubt = nullptr);

/// A number of steps of one size.
struct StepGrid {
  long steps;
  double step;
};
/// Number of steps of about size `step` from `start` to `end` and the size that makes them fit exactly.
/// Throws Misuse for a step that is zero, not finite, or of the wrong sign.
StepGrid fit_steps(double start, double end, double step);

}  // namespace diracstep
