#pragma once

#include <algorithm>
#include <cmath>

namespace diracstep::detail {

/// Watches one event: whether it comes ever faster, or again and again while no time passes.
class ZenoWatch {
 public:
  /// The event was met at t; `scale` is the time that has passed.
  void meet(double t, double scale) {
    const double gap = std::abs(t - last_);
    at_once_ = gap <= round_off * std::max(std::abs(t), scale) ? at_once_ + 1 : 0;
    shrinking_ = std::isfinite(gap) && gap < slowest * gap_ ? shrinking_ + 1 : 0;
    const double ratio = gap / gap_, left = (t - last_) * ratio / (1.0 - ratio);
    limit_ = shrinking_ >= 3 && gap < part * scale ? t + left : std::nan("");
    last_ = t;
    gap_ = gap;
  }
  /// The time at which it would be met infinitely often where that is about to happen, else NaN.
  double limit() const { return limit_; }
  /// Met so often at one time.
  bool chatters() const { return at_once_ >= most_at_once; }

 private:
  static constexpr double slowest = 0.9999, part = 1e-9, round_off = 1e-13;
  static constexpr int most_at_once = 10;
  double last_ = std::nan(""), gap_ = std::nan(""), limit_ = std::nan("");
  int shrinking_ = 0, at_once_ = 0;
};

}  // namespace diracstep::detail
