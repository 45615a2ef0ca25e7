#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/step_comparison.hpp>
#include <sstream>
#include <utility>

namespace diracstep {

namespace {

constexpr double doubted_way = 0.25, doubted_change = 0.5;
constexpr double doubted_of_all = 0.01;  // of the whole motion
constexpr double beyond_usual = 10.0;    // of steps at kinks, times the differences of usual ones
constexpr int higher_order = 3;
constexpr double no_change = 1e-9;  // of a velocity or momentum, in parts of its size
constexpr double from_rest = 0.5;   // of the way of a step, which the velocity at its start makes
constexpr long fewest_steps = 3;    // before velocities and momenta count

std::string line(double time, double part, const char* of) {
  std::ostringstream text;
  text << "step size check: from t = " << time << " two substeps and the whole step differ by "
       << std::round(100.0 * part) << " % of " << of
       << ": the step is too large for the result to be trusted";
  return text.str();
}

}  // namespace

void StepComparison::Differences::add(const Vector& start, const Vector& whole, const Vector& parts,
                                      double t) {
  size = std::max(size, max_norm(whole));
  way = std::max({way, max_norm(whole - start), max_norm(parts - start)});
  const double difference = max_norm(whole - parts);
  if (!(difference > largest)) return;
  largest = difference;
  time = t;
}

bool StepComparison::Differences::doubted() const {
  return largest > doubted_change * std::max(way, no_change * size);
}

void StepComparison::add(const Sample& start, double h, const Sample& whole, const Sample& parts,
                         Place place) {
  ++steps_;
  longest_way_ = std::max({longest_way_, std::abs(h) * max_norm(start.v), max_norm(whole.q - start.q),
                           max_norm(parts.q - start.q)});
  rest_.see(start);
  const double rounding = at_rest * std::max(max_norm(start.q), std::abs(h) * rest_.speed(h));
  if (first_.size() == 0) first_ = start.q;
  extent_ = std::max({extent_, max_norm(start.q - first_), max_norm(whole.q - first_)});
  rounding_ = std::max(rounding_, rounding);
  const double apart = max_norm(whole.q - parts.q), difference = apart / std::max(longest_way_, rounding);
  if (std::abs(h) * max_norm(start.v) < from_rest * max_norm(whole.q - start.q)) {
    if (apart > out_of_rest_) {
      out_of_rest_ = apart;
      out_of_rest_time_ = start.time;
    }
  } else if (difference > 0.0 && !(difference <= worst_)) {
    worst_ = difference;
    worst_time_ = start.time;
  }
  if (longest_way_ <= rounding) return;  // velocities and momenta are round-off
  position_.add(start.q, whole.q, parts.q, start.time);
  velocity_.add(start.v, whole.v, parts.v, start.time);
  momentum_.add(start.p, whole.p, parts.p, start.time);
  const Worst here{apart, max_norm(whole.p - parts.p)};
  if (place == Place::fast) return;
  Worst& worst = place == Place::at_kink ? at_kinks_ : usual_;
  worst = {std::max(worst.position, here.position), std::max(worst.momentum, here.momentum)};
  if (place == Place::usual) return;
  sum_at_kinks_.position += here.position;
  sum_at_kinks_.momentum += here.momentum;
}

double StepComparison::sum_at_kinks() const {
  const double way = std::max(extent_, longest_way_);
  double sum = 0.0;
  if (way > 0.0 && at_kinks_.position > beyond_usual * usual_.position) sum = sum_at_kinks_.position / way;
  if (momentum_.size > 0.0 && at_kinks_.momentum > beyond_usual * usual_.momentum)
    sum = std::max(sum, sum_at_kinks_.momentum / momentum_.size);
  return sum;
}

double StepComparison::worst() const {
  const double out_of_rest = out_of_rest_ > 0.0 ? out_of_rest_ / std::max(longest_way_, rounding_) : 0.0;
  return out_of_rest > 0.0 && !(out_of_rest <= worst_) ? out_of_rest : worst_;
}

double StepComparison::part_of_motion() const {
  const double way = std::max(extent_, longest_way_);
  return std::max(way > 0.0 ? position_.largest / way : 0.0,
                  momentum_.size > 0.0 ? momentum_.largest / momentum_.size : 0.0);
}

std::string StepComparison::text() const {
  if (const double part = worst(); part > doubted_way)
    return line(part > worst_ || std::isnan(worst_) ? out_of_rest_time_ : worst_time_, part,
                "the way of a step");
  if (order_ >= higher_order) {
    const double way = std::max(extent_, longest_way_);
    if (position_.largest > doubted_of_all * way && position_.largest > no_change * position_.size)
      return line(position_.time, position_.largest / way, "the way of the motion");
    if (momentum_.largest > doubted_of_all * momentum_.size)
      return line(momentum_.time, momentum_.largest / momentum_.size, "the largest momentum");
  }
  if (steps_ < fewest_steps) return {};
  if (momentum_.doubted())
    return line(momentum_.time, momentum_.largest / momentum_.way, "the change of the momentum");
  if (velocities_ && velocity_.doubted())
    return line(velocity_.time, velocity_.largest / velocity_.way, "the change of the velocity");
  return {};
}

VelocityChanges::VelocityChanges(Vector start)
    : velocity_(std::move(start)), fast_(max_norm(velocity_) > 0.0) {}

void VelocityChanges::see(ConstVectorRef velocity) {
  const double change = max_norm(velocity - velocity_);
  velocity_ = velocity;
  fast_ = false;
  if (!(change > 2.0 * largest_)) return;
  fast_ = largest_ > 0.0;
  largest_ = change;
}

}  // namespace diracstep
