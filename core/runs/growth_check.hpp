#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// A start whose positions and velocities differ by 1e-13 of the sizes given for each, of the largest where
/// that is zero, in a fixed pattern.  Rows hold
/// at it as at the start itself, to the 1e-10 of require_consistent().
Start beside(const Start& start, const Vector& position_sizes, const Vector& velocity_sizes);
inline constexpr double distance_beside = 1e-13;

/// Measures how much a run amplifies errors, by a second run from beside its start: after it the ends are G
/// times as far apart.  Doubted is a run with G > 1e4 where G times the larger of the round-off, 2.2e-16
/// √steps, and the difference of a step and its parts (StepComparison) exceeds 0.02 of the motion.
///
/// A run of more than 1000 steps, or of more than 12 coordinates and rows together, is followed in two parts
/// of it, at its start and behind its middle, of 1/40 of it each, where that is less of a quarter of it and
/// of 1000 steps.  Each part is judged as a run of its own.  Where errors grow steadily in both, by a factor
/// of 400 or more and in each third of a part by at least the fifth root of its growth, the smaller of the
/// rates is held to be that of the whole run: G is what it comes to.  So a growth that is slower, or none in
/// one of the two parts, is not seen.
class GrowthCheck {
 public:
  /// For the next so many steps.
  GrowthCheck(const Integrator& integrator, long steps);

  /// Points of the run, the start first.
  void see(const Sample& point);
  /// Before the first step, and after each.
  void at_node(Integrator& integrator) {
    if (node_ == next_mark_) mark(integrator);
    ++node_;
  }
  /// At the end of the run, which keeps its bits; `local` is the largest difference so far of a step and its
  /// parts, in parts of the motion.
  void finish(Integrator& integrator, double local);

  /// Empty, or a line that tells the growth.
  const std::string& text() const { return text_; }

 private:
  /// A part of the run: its points at equal distances.
  struct Part {
    long begin, between;  ///< the first of them, and steps from one to the next
    std::vector<Sample> points = {};
  };

  void mark(Integrator& integrator);
  std::vector<double> distances(Integrator& integrator, const Part& part) const;
  void judge(const Part& part, double apart, double local);
  void judge_whole(const std::vector<std::vector<double>>& apart);
  double round_off() const;

  long steps_;
  std::vector<Part> parts_;  ///< none where the run is not watched
  long node_ = 0, next_mark_ = -1;
  double way_ = 0.0, largest_momentum_ = 0.0, largest_velocity_ = 0.0;
  Vector first_;  ///< where the run starts
  std::string text_;
};

}  // namespace diracstep
