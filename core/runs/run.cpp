#include <algorithm>
#include <cmath>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/runs/run_points.hpp>

namespace diracstep {

namespace {

detail::RunOf<Integrator, CheckedSteps, RunChecks> run_of(Integrator& integrator, Momentum momentum,
                                                          long every, const Observer& observer,
                                                          RunChecks* checks) {
  return {integrator, {integrator, checks}, momentum, every, observer, checks};
}

auto size_of(const Integrator& integrator) {
  return [&integrator] { return integrator.options().step; };
}

}  // namespace

RunReport run_steps(Integrator& integrator, long steps, Momentum momentum, long every,
                    const Observer& observer, RunChecks* checks) {
  RunReport report = run_of(integrator, momentum, every, observer, checks).steps(steps);
  if (checks != nullptr && report.last.ok()) checks->finish(integrator);
  return report;
}

RunReport run_until(Integrator& integrator, double end, Momentum momentum, long every,
                    const Observer& observer, RunChecks* checks) {
  return run_of(integrator, momentum, every, observer, checks).until(end, size_of(integrator));
}

RunReport run_at(Integrator& integrator, std::span<const double> times, Momentum momentum,
                 const Observer& observer) {
  return run_of(integrator, momentum, 1, observer, nullptr).at(times, size_of(integrator));
}

StepReport sample_at(Integrator& integrator, double t, Momentum momentum, Sample& sample) {
  StepReport report;
  if (const double size = t - integrator.time(); size != 0.0) {
    const Snapshot here = integrator.save();
    report = integrator.step(size);
    if (report.ok()) report.solve = integrator.sample(momentum, sample);
    integrator.restore(here);
    sample.time = t;
  } else {
    report.solve = integrator.sample(momentum, sample);
  }
  if (!report.ok() && report.failure.empty())
    report.failure = "reading the state at t = " + to_text(t) + ": " + describe(report.solve.status);
  return report;
}

StepGrid fit_steps(double start, double end, double step) {
  require_step(step);
  const double ratio = (end - start) / step;
  if (!(ratio > 0.0) || !std::isfinite(ratio))
    throw Misuse("no steps of size " + to_text(step) + " lead from t = " + to_text(start) +
                 " to t = " + to_text(end));
  const double nearest = std::max(1.0, std::round(ratio));
  const double count = std::abs(ratio - nearest) <= 1e-9 * nearest ? nearest : std::ceil(ratio);
  if (count > 1e15)
    throw Misuse("the step size " + to_text(step) + " is too small: " + to_text(count) +
                 " steps would be needed, at most 1e15 are taken");
  return {static_cast<long>(count), (end - start) / count};
}

}  // namespace diracstep
