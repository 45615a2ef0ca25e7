#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <string>

namespace diracstep {

/// A start whose positions and velocities differ by 1e-13 of the sizes given, in a fixed pattern.  Rows hold
/// at it as at the start itself, to the 1e-10 of require_consistent().
Start beside(const Start& start, double position_size, double velocity_size);
inline constexpr double distance_beside = 1e-13;

/// Measures how much a run amplifies errors, by a second run from beside its start: after it the ends are G
/// times as far apart.  Doubted is a run with G > 1e4 where G times the larger of the round-off, 2.2e-16
/// √steps, and the difference of a step and its parts (StepComparison) exceeds 0.02 of the motion.
///
/// Only for runs of at most 1000 steps from a start, of at most 12 coordinates and rows together,
/// so that it takes some milliseconds.
class GrowthCheck {
 public:
  /// For the next so many steps.
  GrowthCheck(const Integrator& integrator, long steps);

  /// Points of the run, the start first.
  void see(const Sample& point);
  /// At the end of the run, which keeps its bits; `local` is the largest difference so far of a step and its
  /// parts, in parts of the motion.
  void finish(Integrator& integrator, double local);

  /// Empty, or a line that tells the growth.
  const std::string& text() const { return text_; }

 private:
  long steps_;
  bool watched_;
  Start first_;  ///< where the run starts
  double way_ = 0.0, largest_momentum_ = 0.0, largest_velocity_ = 0.0;
  std::string text_;
};

}  // namespace diracstep
