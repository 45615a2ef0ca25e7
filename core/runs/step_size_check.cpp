#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/step_size_check.hpp>
#include <sstream>

namespace diracstep {

namespace {

constexpr long steps_for_a_look = 600, fewest_looks = 3;
constexpr double doubted = 0.25;

}  // namespace

StepSizeCheck::StepSizeCheck(const Integrator& integrator, long steps)
    : between_looks_(std::clamp(steps / fewest_looks, 1L, steps_for_a_look)),
      next_look_(integrator.work().steps + std::min(1L, steps - 1)) {}  // the first step may be one from rest

void StepSizeCheck::halve(Integrator& integrator) {
  next_look_ += between_looks_;
  start_time_ = integrator.time();
  start_ = integrator.position();
  longest_way_ =
      std::max(longest_way_, std::abs(integrator.options().step) * max_norm(integrator.velocity_estimate()));
  const Snapshot state = integrator.save();
  const double half = 0.5 * integrator.options().step;
  halved_ = integrator.step(half).ok() && integrator.step(half).ok();
  end_of_halves_ = integrator.position();
  integrator.restore(state);
}

void StepSizeCheck::compare(const Integrator& integrator) {
  halved_ = false;
  const Vector& end = integrator.position();
  longest_way_ = std::max({longest_way_, max_norm(end - start_), max_norm(end_of_halves_ - start_)});
  const double difference =
      max_norm(end - end_of_halves_) / std::max(longest_way_, at_rest * max_norm(start_));
  if (!(difference > 0.0) || difference <= worst_) return;
  worst_ = difference;
  if (worst_ <= doubted) return;
  std::ostringstream text;
  text << "two half steps from t = " << start_time_ << " end " << std::round(100.0 * worst_)
       << " % of the way of a step beside the whole one: the step is too large to believe the result";
  text_ = text.str();
}

}  // namespace diracstep
