#include <algorithm>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/step_size_check.hpp>

namespace diracstep {

namespace {

constexpr long steps_for_a_look = 600, fewest_looks = 3;

}  // namespace

StepSizeCheck::StepSizeCheck(const Integrator& integrator, long steps)
    : comparison_(integrator.scene(), integrator.method().order),
      between_looks_(std::clamp(steps / fewest_looks, 1L, steps_for_a_look)),
      next_look_(integrator.work().steps + std::min(1L, steps - 1)),
      fast_(max_norm(integrator.velocity_estimate()) > 0.0),
      velocity_(integrator.velocity_estimate()) {}

void StepSizeCheck::divide(Integrator& integrator) {
  fast_ = false;
  const Snapshot state = integrator.save();
  const double h = integrator.options().step, first = StepComparison::first_part * h;
  divided_ = integrator.sample(Momentum::projected, start_).ok() && integrator.step(first).ok() &&
             integrator.step(h - first).ok() && integrator.sample(Momentum::projected, parts_).ok();
  integrator.restore(state);
}

void StepSizeCheck::follow(const Integrator& integrator) {
  const double change = max_norm(integrator.velocity_estimate() - velocity_);
  velocity_ = integrator.velocity_estimate();
  if (!(change > 2.0 * largest_change_)) return;
  fast_ = largest_change_ > 0.0;
  largest_change_ = change;
}

void StepSizeCheck::compare(Integrator& integrator) {
  divided_ = false;
  if (!integrator.sample(Momentum::projected, whole_).ok()) return;
  comparison_.add(start_, integrator.options().step, whole_, parts_);
}

}  // namespace diracstep
