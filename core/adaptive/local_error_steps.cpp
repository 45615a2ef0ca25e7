#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <limits>

/// The steps of an AdaptiveIntegrator by their local error.
namespace diracstep {

namespace {

/// Whether nothing is left to step between two times, for steps of this size.
bool is_same_time(double a, double b, double size) {
  constexpr double part = 1e-12, units = 4.0 * std::numeric_limits<double>::epsilon();
  return std::abs(a - b) <= std::max(part * std::abs(size), units * std::abs(a));
}

/// The first of the instants from `next` on that a motion at t has not come to; several may share a time.
std::size_t next_instant(const std::vector<double>& instants, std::size_t next, double t, double sign,
                         double size) {
  while (next < instants.size() &&
         (sign * (instants[next] - t) <= 0.0 || is_same_time(t, instants[next], size)))
    ++next;
  return next;
}

}  // namespace

void AdaptiveIntegrator::start_local_control() {
  local_->start(main_);
  whole_->reset();
  local_work_ = {};
  instant_ = next_instant(instants_, 0, time(), sign_, local_->first_size());
  next_size_ = up_to_instant(sign_ * local_->first_size());
}

/// From a point that the motion has jumped to.
void AdaptiveIntegrator::go_on_local_control() {
  instant_ = next_instant(instants_, 0, time(), sign_, next_size_);
  next_size_ = up_to_instant(sign_ * std::min(std::abs(next_size_), local_->first_size()));
}

/// The size where it is none of the longest, or a part of what is left to the next instant.
double AdaptiveIntegrator::up_to_instant(double size) const {
  if (std::abs(size) > longest_) size = sign_ * longest_;
  if (instant_ == instants_.size()) return size;
  const double left = instants_[instant_] - main_.time();
  if (std::abs(size) < 0.5 * std::abs(left)) return size;
  return std::abs(size) < 0.99 * std::abs(left) ? 0.5 * left : left;
}

StepReport AdaptiveIntegrator::error_step() {
  double size = next_size_;
  StepReport report = local_->advance(main_, *whole_, size, next_size_);
  report_.refused = local_->refused();
  const long steps = local_work_.steps;
  local_work_ = main_.work();
  local_work_.add(whole_->work());
  local_work_.steps = report.ok() ? steps + 1 : steps;
  if (!report.ok()) return report;
  note(size);
  const std::size_t next = next_instant(instants_, instant_, time(), sign_, size);
  if (next > instant_) next_size_ = sign_ * std::min(std::abs(next_size_), local_->first_size());
  instant_ = next;
  next_size_ = up_to_instant(next_size_);
  return report;
}

/// From the current node to t with the side integrator, each step judged as those of the motion are.
StepReport AdaptiveIntegrator::side_steps_to(double t) {
  LocalErrorControl beside = *local_;
  StepReport report;
  double next = t - side_.time();
  while (report.ok() && !is_same_time(t, side_.time(), next_size_)) {
    const double left = t - side_.time();
    double size = std::abs(next) < std::abs(left) ? next : left;
    report = beside.advance(side_, *whole_, size, next);
    ++report_.side_steps;
    kinks_beside_ = kinks_beside_ || !side_.kinks_passed().empty() || !whole_->kinks_passed().empty();
  }
  return report;
}

}  // namespace diracstep
