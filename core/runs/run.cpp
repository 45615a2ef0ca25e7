#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <sstream>

namespace diracstep {

RunReport run(Integrator& integrator, long steps, Momentum momentum, long every, const Observer& observer,
              RunChecks* doubt) {
  Sample sample;
  RunReport report;
  const auto observed = [&](long k) {
    if ((!observer && doubt == nullptr) || (k % every != 0 && k != steps)) return true;
    report.last.solve = integrator.sample(momentum, sample);
    if (!report.last.ok()) {
      std::ostringstream message;
      message << "reading the state at t = " << integrator.time() << ": "
              << describe(report.last.solve.status);
      report.last.failure = message.str();
      return false;
    }
    if (doubt != nullptr) doubt->see(sample);
    return !observer || observer(sample);
  };
  if (every < 1) throw Misuse("every = " + std::to_string(every) + "; 1 or more is needed");
  if (!observed(0)) return report;
  for (long k = 1; k <= steps; ++k) {
    if (doubt != nullptr) doubt->before_step(integrator);
    report.last = integrator.step();
    if (!report.last.ok()) break;
    if (doubt != nullptr) doubt->after_step(integrator);
    if (!observed(k)) break;
  }
  return report;
}

StepGrid fit_steps(double start, double end, double step) {
  require_step(step);
  const double ratio = (end - start) / step;
  if (!(ratio > 0.0) || !std::isfinite(ratio)) {
    std::ostringstream message;
    message << "no steps of size " << step << " lead from t = " << start << " to t = " << end;
    throw Misuse(message.str());
  }
  const double nearest = std::max(1.0, std::round(ratio));
  const double count = std::abs(ratio - nearest) <= 1e-9 * nearest ? nearest : std::ceil(ratio);
  if (count > 1e15) {
    std::ostringstream message;
    message << "the step size " << step << " is too small: " << count
            << " steps would be needed, at most 1e15 are taken";
    throw Misuse(message.str());
  }
  return {static_cast<long>(count), (end - start) / count};
}

}  // namespace diracstep
