#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/adaptive/variable_run_checks.hpp>
#include <diracstep/core/runs/run_points.hpp>

namespace diracstep {

namespace {

/// The steps of an integrator, with the checks around each where there are any.
struct CheckedVariableSteps {
  AdaptiveIntegrator& integrator;
  VariableRunChecks* checks;

  StepReport step() const {
    if (checks != nullptr) checks->before_step();
    StepReport report = integrator.step();
    if (checks != nullptr && report.ok()) checks->after_step();
    return report;
  }
};

detail::RunOf<AdaptiveIntegrator, CheckedVariableSteps, VariableRunChecks> run_of(
    AdaptiveIntegrator& integrator, Momentum momentum, long every, const Observer& observer,
    VariableRunChecks* checks) {
  return {integrator, {integrator, checks}, momentum, every, observer, checks};
}

auto size_of(const AdaptiveIntegrator& integrator) {
  return [&integrator] { return integrator.next_size(); };
}

}  // namespace

RunReport run_steps(AdaptiveIntegrator& integrator, long steps, Momentum momentum, long every,
                    const Observer& observer, VariableRunChecks* checks) {
  return run_of(integrator, momentum, every, observer, checks).steps(steps);
}

RunReport run_until(AdaptiveIntegrator& integrator, double end, Momentum momentum, long every,
                    const Observer& observer, VariableRunChecks* checks) {
  return run_of(integrator, momentum, every, observer, checks).until(end, size_of(integrator));
}

RunReport run_at(AdaptiveIntegrator& integrator, std::span<const double> times, Momentum momentum,
                 const Observer& observer, VariableRunChecks* checks) {
  return run_of(integrator, momentum, 1, observer, checks).at(times, size_of(integrator));
}

StepReport sample_at(AdaptiveIntegrator& integrator, double t, Momentum momentum, Sample& sample) {
  return integrator.sample_at(t, momentum, sample);
}

}  // namespace diracstep
