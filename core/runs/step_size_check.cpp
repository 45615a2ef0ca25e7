#include <algorithm>
#include <diracstep/core/runs/step_size_check.hpp>

namespace diracstep {

namespace {

constexpr long steps_for_a_look = 600, fewest_looks = 3;

}  // namespace

StepSizeCheck::StepSizeCheck(const Integrator& integrator, long steps)
    : between_looks_(std::clamp(steps / fewest_looks, 1L, steps_for_a_look)),
      next_look_(integrator.work().steps + std::min(1L, steps - 1)) {}  // the first step may be one from rest

void StepSizeCheck::halve(Integrator& integrator) {
  next_look_ += between_looks_;
  const Snapshot state = integrator.save();
  const double half = 0.5 * integrator.options().step;
  halved_ = integrator.sample(Momentum::projected, start_).ok() && integrator.step(half).ok() &&
            integrator.step(half).ok() && integrator.sample(Momentum::projected, halves_).ok();
  integrator.restore(state);
}

void StepSizeCheck::compare(Integrator& integrator) {
  halved_ = false;
  if (!integrator.sample(Momentum::projected, whole_).ok()) return;
  comparison_.add(start_, integrator.options().step, whole_, halves_);
}

}  // namespace diracstep
