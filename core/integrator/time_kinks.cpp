#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/time_kinks.hpp>
#include <limits>

namespace diracstep {

namespace {

constexpr double steps_in_a_window = 4096.0;  // about as many as are looked at in it at least
constexpr double gap = 8.0 * std::numeric_limits<double>::epsilon();  // of t, on both sides of a kink
constexpr double apart = 4.0;  // of these gaps, from the ends of a step

}  // namespace

TimeKinks::TimeKinks(std::shared_ptr<const Kinks> kinks, double start, double usual_step)
    : kinks_(std::move(kinks)), start_(start), width_(steps_in_a_window * std::abs(usual_step)) {}

void TimeKinks::look_at_window(double number) {
  if (any_known_ && number == window_) return;
  window_ = number;
  any_known_ = true;
  known_.clear();
  pulses_.clear();
  const double first = start_ + number * width_;
  for (const Kinks::Instant& instant : kinks_->instants(first, first + width_))
    (instant.width == 0.0 ? known_ : pulses_).push_back(instant.time);
}

void TimeKinks::add_pulses(Interval step, std::vector<double>& times) {
  if (!kinks_ || std::abs(step.size) > width_) return;
  const double end = step.start + step.size, first = std::min(step.start, end),
               last = std::max(step.start, end);
  const double from = std::floor((first - start_) / width_), to = std::floor((last - start_) / width_);
  for (double number = from; number <= to; number += 1.0) {
    look_at_window(number);
    for (const double t : pulses_)
      if (t > first && t < last) times.push_back(t);
  }
}

/// Those from `first` to `last`, ascending.
void TimeKinks::add_times(double first, double last) {
  times_.clear();
  const double from = std::floor((first - start_) / width_), to = std::floor((last - start_) / width_);
  for (double number = from; number <= to; number += 1.0) {
    look_at_window(number);
    for (const double t : known_)
      if (t >= first && t <= last && (times_.empty() || t > times_.back())) times_.push_back(t);
  }
}

bool TimeKinks::divide(Interval step, std::vector<Interval>& parts) {
  parts.assign(1, step);
  if (!kinks_) return false;
  const double end = step.start + step.size,
               reach = apart * gap * std::max(std::abs(step.start), std::abs(end));
  if (std::abs(step.size) > width_ || !(std::abs(step.size) > 4.0 * reach)) return false;
  add_times(std::min(step.start, end) - reach, std::max(step.start, end) + reach);
  if (times_.empty()) return false;
  if (step.size < 0.0) std::ranges::reverse(times_);
  parts.clear();
  double from = step.start;
  const auto add_part = [&](double to) {
    if ((to - from) * step.size > 2.0 * reach * std::abs(step.size)) parts.push_back({from, to - from});
  };
  for (const double t : times_) {
    const double beside = std::copysign(gap * std::abs(t), step.size);
    add_part(t - beside);
    from = t + beside;
  }
  if ((end - from) * step.size > 0.0) add_part(end);
  if (parts.empty()) parts.assign(1, step);
  return true;
}

}  // namespace diracstep
