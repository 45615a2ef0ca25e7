#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/step_size_check.hpp>
#include <sstream>

namespace diracstep {

namespace {

constexpr long steps_for_a_look = 600, fewest_looks = 3;
constexpr double shortest_part = 1e-6;     // of a step, behind a kink
constexpr double doubted_at_kinks = 2e-4;  // of the motion

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
  comparison_.add(start_, integrator.options().step, whole_, parts_, place_);
}

void StepSizeCheck::keep_kinks(Integrator& integrator) {
  if (++over_kinks_ < next_over_kinks_) return;
  next_over_kinks_ = over_kinks_ < fewest_looks ? over_kinks_ + 1 : 2 * over_kinks_;
  if (!integrator.sample(Momentum::projected, end_).ok()) return;
  kinks_.assign(integrator.kinks_passed().begin(), integrator.kinks_passed().end());
}

/// Between the kinks of the last step, and from the last of them to its end.
void StepSizeCheck::look_behind_kinks(Integrator& integrator) {
  const Snapshot state = integrator.save();
  for (std::size_t k = 0; k < kinks_.size(); ++k) {
    const bool last = k + 1 == kinks_.size();
    const double size = (last ? end_.time : kinks_[k + 1].time) - kinks_[k].time,
                 first = StepComparison::first_part * size;
    if (!(std::abs(size) > shortest_part * std::abs(integrator.options().step)) ||
        !integrator.sample(kinks_[k], Momentum::projected, start_).ok())
      continue;
    if (last)
      whole_ = end_;
    else if (!integrator.sample(kinks_[k + 1], Momentum::projected, whole_).ok())
      continue;
    integrator.restart(kinks_[k].time, kinks_[k].at.q, kinks_[k].at.p, start_.v);
    if (integrator.step(first).ok() && integrator.step(size - first).ok() &&
        integrator.sample(Momentum::projected, parts_).ok())
      comparison_.add(start_, size, whole_, parts_, StepComparison::Place::at_kink);
  }
  ++looks_at_kinks_;
  kinks_.clear();
  integrator.restore(state);
}

std::string StepSizeCheck::text() const {
  if (std::string text = comparison_.text(); !text.empty() || looks_at_kinks_ == 0) return text;
  const double part = comparison_.sum_at_kinks() / static_cast<double>(looks_at_kinks_);
  const double all = part * static_cast<double>(over_kinks_);
  if (!(all > doubted_at_kinks)) return {};
  std::ostringstream text;
  text.precision(2);
  text << "step size check: at kinks of the force two substeps and the whole step differ by "
       << std::min(1.0, part) << " of the motion, far more than elsewhere, and " << over_kinks_
       << " steps cross some: what acts behind them, as a contact, is too short for the steps; take shorter "
          "ones, or ask for an error, --error";
  return text.str();
}

}  // namespace diracstep
