#pragma once

#include <diracstep/core/system/scene.hpp>
#include <vector>

namespace diracstep {

/// How fast a motion passes the ramps and pulses that the formulas of its scene show (Scene::kinks), in
/// radians per unit of time:
///
///   ω² = Σ ġ² / (1 + g²)  over the ramps' arguments g,  + Σ 1 / (w² + (t − c)²)  over the instants near t of
///   centre c and width w > 0.
///
/// Steps of eps/ω come to a ramp of argument g by eps |g| at most, and pass it in parts of |Δg| = eps: its
/// asinh is the angle.  Even in the direction of time, as a monitor of reversible steps is to be.
class RampRates {
 public:
  /// Instants are those between two times; none where these are not finite.  The scene outlives this.
  RampRates(const Scene& scene, double first, double last);

  bool none() const { return count_ == 0 && instants_.empty(); }
  /// Number of switching functions that evaluate() gives.
  Eigen::Index count() const { return count_; }
  void evaluate(double t, ConstVectorRef q, ConstVectorRef v, VectorRef g) const;
  /// ω², from g at t − delta, t and t + delta along the motion.
  double squared(double t, ConstVectorRef before, ConstVectorRef here, ConstVectorRef after,
                 double delta) const;

 private:
  std::shared_ptr<const Kinks> kinks_;
  Eigen::Index count_ = 0;
  std::vector<Kinks::Instant> instants_;  ///< of a width above 0, ascending
};

}  // namespace diracstep
