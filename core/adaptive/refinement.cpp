#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/adaptive/refinement.hpp>

namespace diracstep {

namespace {

constexpr double safety = 2.5;  // between the estimate and the error asked for
constexpr double aimed = 0.2;   // part of the error asked for that the next run aims at

double relative_change(const Vector& a, const Vector& b) {
  const double size = b.lpNorm<Eigen::Infinity>(), change = (a - b).lpNorm<Eigen::Infinity>();
  return size > 1e-14 ? change / size : change;
}

/// p with  d1/d2 = (h0^p − h1^p)/(h1^p − h2^p);  the right side rises with p.
double observed_order(const std::array<double, 3>& h, double d1, double d2) {
  if (!(d1 > 0.0) || !(d2 > 0.0)) return std::nan("");
  double low = 0.01, high = 40.0;
  for (int k = 0; k < 60; ++k) {
    const double p = 0.5 * (low + high);
    const double a = std::pow(h[0] / h[1], p), b = std::pow(h[2] / h[1], p);
    ((a - 1.0) / (1.0 - b) < d1 / d2 ? low : high) = p;
  }
  return 0.5 * (low + high);
}

}  // namespace

double relative_change(const Sample& from, const Sample& to) {
  return std::max(relative_change(from.q, to.q), relative_change(from.p, to.p));
}

void Refinement::add(ErrorControlRun& run) {
  if (!runs_.empty()) {
    const ErrorControlRun& last = newest();
    run.estimate = run.difference / (std::pow(last.step / run.step, order_) - 1.0);
    if (runs_.size() >= 2) {
      run.observed_order =
          observed_order({before().step, last.step, run.step}, last.difference, run.difference);
      // An order that falls short of the stated one makes the stated one too hopeful.
      const double usable = std::clamp(run.observed_order, 1.0, static_cast<double>(order_));
      if (usable < order_ - 1.0)
        run.estimate = run.difference / (std::pow(last.step / run.step, usable) - 1.0);
    }
    const bool fell = !(run.difference > 0.5 * last.difference) || run.difference > 1e-4;
    stagnant_ = fell ? 0 : stagnant_ + 1;
  }
  if (runs_.size() == 3) runs_.erase(runs_.begin());
  runs_.push_back(run);
}

bool Refinement::accepted() const {
  if (runs_.size() < 3) return false;
  if (std::abs(newest().observed_order - order_) <= 1.0) return safety * newest().estimate <= error_;
  // A higher order than the stated one shows steps that are still coarse: there the difference itself has
  // to do. A lower one comes with round-off.
  const bool high = newest().observed_order > order_;
  const double before_allowed = high ? HUGE_VAL : error_ / safety;
  return before().difference <= before_allowed && safety * newest().difference <= error_;
}

double Refinement::next_factor() const {
  const double estimate = newest().estimate;
  if (!(estimate > 0.0) || stagnant_ > 0) return 0.7;
  return std::clamp(std::pow(aimed * error_ / estimate, 1.0 / order_), 0.35, 0.7);
}

}  // namespace diracstep
