#pragma once

#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <utility>

namespace diracstep {

/// Tells the steps behind those in which the velocity changed by more than twice as much as ever before: the
/// motion came to something new, or runs away.
class VelocityChanges {
 public:
  /// A first step that does not start from rest is told too.
  explicit VelocityChanges(Vector start) : velocity_(std::move(start)), fast_(max_norm(velocity_) > 0.0) {}

  /// After each step.
  void see(ConstVectorRef velocity) {
    const double change = max_norm(velocity - velocity_);
    velocity_ = velocity;
    fast_ = false;
    if (!(change > 2.0 * largest_)) return;
    fast_ = largest_ > 0.0;
    largest_ = change;
  }
  bool fast() const { return fast_; }

 private:
  Vector velocity_;
  double largest_ = 0.0;
  bool fast_;
};

}  // namespace diracstep
