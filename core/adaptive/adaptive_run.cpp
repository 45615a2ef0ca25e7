#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/runs/run_points.hpp>

namespace diracstep {

namespace {

detail::RunOf<AdaptiveIntegrator, AdaptiveIntegrator&> run_of(AdaptiveIntegrator& integrator,
                                                              Momentum momentum, long every,
                                                              const Observer& observer) {
  return {integrator, integrator, momentum, every, observer, nullptr};
}

auto size_of(const AdaptiveIntegrator& integrator) {
  return [&integrator] { return integrator.next_size(); };
}

}  // namespace

RunReport run_steps(AdaptiveIntegrator& integrator, long steps, Momentum momentum, long every,
                    const Observer& observer) {
  return run_of(integrator, momentum, every, observer).steps(steps);
}

RunReport run_until(AdaptiveIntegrator& integrator, double end, Momentum momentum, long every,
                    const Observer& observer) {
  return run_of(integrator, momentum, every, observer).until(end, size_of(integrator));
}

RunReport run_at(AdaptiveIntegrator& integrator, std::span<const double> times, Momentum momentum,
                 const Observer& observer) {
  return run_of(integrator, momentum, 1, observer).at(times, size_of(integrator));
}

StepReport sample_at(AdaptiveIntegrator& integrator, double t, Momentum momentum, Sample& sample) {
  return integrator.sample_at(t, momentum, sample);
}

}  // namespace diracstep
