#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/step_plan.hpp>
#include <diracstep/core/runs/run.hpp>

namespace diracstep {

StepPlan::StepPlan(std::vector<Stretch> stretches, double step) : stretches_(std::move(stretches)) {
  for (Stretch& stretch : stretches_) {
    stretch.steps =
        fit_steps(stretch.begin, stretch.end, std::copysign(step, stretch.end - stretch.begin)).steps;
    steps_ += stretch.steps;
  }
}

double StepPlan::mean_step(long refinement) const {
  return (stretches_.back().end - stretches_.front().begin) / static_cast<double>(steps_ * refinement);
}

StepReport StepPlan::run(Integrator& integrator, long refinement,
                         const std::function<bool()>& at_node) const {
  StepReport report;
  for (const Stretch& stretch : stretches_) {
    if (&stretch != &stretches_.front()) {
      const Vector q = integrator.position(), p = integrator.momentum(), v = integrator.velocity_estimate();
      integrator.restart(stretch.begin, q, p, v);
    }
    const double h = step_in(stretch, refinement);
    for (long k = 0; k < stretch.steps * refinement; ++k) {
      report = integrator.step(h);
      if (!report.ok() || !at_node()) return report;
    }
  }
  return report;
}

}  // namespace diracstep
