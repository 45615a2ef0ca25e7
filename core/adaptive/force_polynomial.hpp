#pragma once

#include <diracstep/core/numerics/path_cubic.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/scene.hpp>
#include <optional>
#include <vector>

namespace diracstep {

/// F = (∂L/∂q + f, ∂L/∂v, A v + b) along a run, and the polynomial through its values at 12 Chebyshev points
/// of a part of the run.
class ForcePolynomial {
 public:
  /// For forces whose impulse counts from `error` times the largest momentum on.  The scene, one with a
  /// Lagrangian, must outlive this.
  ForcePolynomial(const Scene& scene, double error);

  /// Finds the sizes of F along a run.
  void find_scales(const std::vector<PathPoint>& path);

  /// Makes the polynomial of F on (a, b) and compares it with F at `points` points between, at others that
  /// approach both ends, and at known times: the largest difference over what is allowed, so that above 1 the
  /// polynomial misses F.
  double fit(const PathCubic& path, double a, double b, long points, const std::vector<double>& known);

  /// How far the last polynomial is from F at a time: the worst component, in parts of the largest momentum
  /// over the unit of time.
  double miss(const PathCubic& path, double t);

  /// Whether F is not the same on both sides of the point where one cubic ends and the next begins.
  bool jumps(const PathCubic& before, const PathCubic& after);

  /// Counts what the rounding of the times of its nodes leaves of the impulse of F over the part that the
  /// last polynomial is of.  Parts are counted in the order of the motion.
  void count_rounding(const PathCubic& path);
  /// The standard deviation of all that was counted, in parts of the largest momentum: steps read F at times
  /// that are rounded, and all of the change of a narrow pulse lies within few units of round-off.
  double rounding() const;

  /// So close to t two times count as one.
  double closest(double t) const;
  double span() const { return span_; }
  long readings() const { return readings_; }
  /// Whether no force, no time and no kinks enter, as far as is known.
  bool smooth() const { return smooth_; }

 private:
  void read(const PathCubic& path, double t, VectorRef f) { read(path, t, t, f); }
  void read(const PathCubic& path, double place, double t, VectorRef f);

  const Scene& scene_;
  double error_;
  Eigen::Index n_, m_;
  ConstraintsAtPoint rows_;
  bool smooth_;
  Vector allowed_, weights_;  ///< of each component of F, and what turns it into parts of the momentum
  Vector q_, v_, p_, external_, local_, value_, other_;
  double part_of_momentum(const Vector& squares) const;
  Vector rounding_;                   ///< squares of impulses
  std::optional<double> counted_to_;  ///< time of the last node counted
  Columns samples_;
  double span_ = 0.0, middle_ = 0.0, half_ = 1.0;  ///< of the motion, and of the last polynomial
  long readings_ = 0;
};

}  // namespace diracstep
