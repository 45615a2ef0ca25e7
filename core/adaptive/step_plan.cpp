#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/step_plan.hpp>
#include <diracstep/core/runs/run.hpp>
#include <limits>

namespace diracstep {

namespace {

constexpr std::size_t most_known_cuts = 200;

/// Leads over a gap between two stretches, with the impulse of the forces on both its sides: in a pulse of a
/// few thousand units of round-off in t it counts.
void cross_gap(Integrator& integrator, double t) {
  const double before = integrator.time();
  const Vector q = integrator.position(), v = integrator.velocity_estimate();
  Vector p = integrator.momentum();
  const Scene& scene = integrator.scene();
  if (t != before && scene.force) {
    Vector from(p.size()), to(p.size());
    scene.force->value(before, q, v, from);
    scene.force->value(t, q, v, to);
    p += 0.5 * (t - before) * (from + to);
  }
  integrator.restart(t, q, p, v);
}

}  // namespace

std::vector<Stretch> known_stretches(const Scene& scene, double end) {
  const double start = scene.start.time;
  std::vector<Stretch> stretches{{start, end}};
  if (!scene.kinks) return stretches;
  std::vector<Kinks::Instant> known = scene.kinks->instants(std::min(start, end), std::max(start, end));
  std::erase_if(known, [](const Kinks::Instant& instant) { return instant.width > 0.0; });
  if (known.size() > most_known_cuts) return stretches;
  if (end < start) std::ranges::reverse(known);
  for (const Kinks::Instant& instant : known) {
    const double t = instant.time;
    const double gap = std::copysign(8.0 * std::numeric_limits<double>::epsilon() * std::abs(t), end - start);
    Stretch& last = stretches.back();
    if (gap == 0.0 || (t - last.begin) / gap < 4.0 || (end - t) / gap < 4.0) continue;
    last.end = t - gap;
    stretches.push_back({t + gap, end});
  }
  return stretches;
}

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

StepReport StepPlan::run(Integrator& integrator, long refinement, const std::function<bool()>& at_node,
                         const std::function<bool(const KinkPassed&)>& at_kink) const {
  StepReport report;
  for (const Stretch& stretch : stretches_) {
    if (&stretch != &stretches_.front()) {
      cross_gap(integrator, stretch.begin);
    }
    const double h = step_in(stretch, refinement);
    for (long k = 0; k < stretch.steps * refinement; ++k) {
      report = integrator.step(h);
      if (!integrator.stuck_at_kink().empty()) {
        report.solve.status = SolveStatus::no_convergence;
        report.failure = integrator.stuck_at_kink();
      } else if (integrator.unresolved_between_kinks() > unresolved_allowed_) {
        report.solve.status = SolveStatus::no_convergence;
        report.failure = "steps are too long for what lies between two kinks that one of them crosses";
      }
      if (!report.ok() || !std::ranges::all_of(integrator.kinks_passed(), at_kink) || !at_node())
        return report;
    }
  }
  return report;
}

}  // namespace diracstep
