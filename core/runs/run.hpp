#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <functional>
#include <span>

namespace diracstep {

/// Called at kept points; returning false ends the run there.
using Observer = std::function<bool(const Sample&)>;

/// What a run did; `failure` of the last step is empty or says why it stopped early.  What was observed
/// before stays valid.
struct [[nodiscard]] RunReport {
  StepReport last;
  bool ok() const { return last.ok(); }
};

// A run of an Integrator and one of an AdaptiveIntegrator (adaptive/adaptive_run.hpp) are called alike and
// mean the same.  All of them throw Misuse for `every` below 1, before anything is done.

/// Takes `steps` steps and shows the start, every `every`-th point and the last one to the observer, where
/// there is one.  `checks`, made for as many steps, see the same points and every step; their text() then
/// says why the result is not to be believed, or nothing.
RunReport run_steps(Integrator& integrator, long steps, Momentum momentum = Momentum::projected,
                    long every = 1, const Observer& observer = nullptr, RunChecks* checks = nullptr);

/// Steps as long as the next one does not pass the time `end`, and shows the start, every `every`-th point
/// and the motion at `end`.  Where `end` lies between two steps, one shorter step leads there and is taken
/// back: the integrator stays at the last point before it, and goes on with the same bits as if it had not
/// been read.  Throws Misuse where `end` is not finite or does not lie ahead.
RunReport run_until(Integrator& integrator, double end, Momentum momentum = Momentum::projected,
                    long every = 1, const Observer& observer = nullptr, RunChecks* checks = nullptr);

/// Shows the motion at the given times, which must run from the current point in the direction of the step,
/// by such shorter steps.  Throws Misuse for times out of order.
RunReport run_at(Integrator& integrator, std::span<const double> times,
                 Momentum momentum = Momentum::projected, const Observer& observer = nullptr);

/// Reads the motion at another time by a step to there, which is then taken back bit by bit.  Full order for
/// times within about a step from the current one.
StepReport sample_at(Integrator& integrator, double t, Momentum momentum, Sample& sample);

/// A number of steps of one size.
struct StepGrid {
  long steps;
  double step;
};
/// Number of steps of about size `step` from `start` to `end` and the size that makes them fit exactly.
/// Throws Misuse for a step that is zero, not finite, or of the wrong sign.
StepGrid fit_steps(double start, double end, double step);

}  // namespace diracstep
