#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <string>

namespace diracstep {

/// Follows the velocity along a run, to say when a motion may have left its branch: where rows depend on each
/// other, as in the flat pose of a four-bar mechanism, true motions cross, and a step over such a pose may
/// end on any of them, with every row and the energy kept.  Doubted is a step that
///
///  * turns the mean velocity w by more than half the largest |w|∞ of the run so far, and
///  * passes a pose where the rows depend on each other, A being taken to change along a line in the step.
///
/// The second is looked at only where the first holds.
class BranchCheck {
 public:
  /// The integrator's scene must outlive this.
  explicit BranchCheck(const Integrator& integrator);

  /// After each step.
  void after(const Integrator& integrator) {
    if (watched_) look(integrator);
  }

  /// Empty, or a line that names the first such step.
  const std::string& text() const { return text_; }

 private:
  void look(const Integrator& integrator);
  bool rows_depend_on_the_way(const Integrator& integrator);

  ConstraintsAtPoint rows_;
  bool watched_;
  int examinations_ = 0;
  double largest_speed_ = 0.0;
  Vector velocity_;
  std::string text_;
};

}  // namespace diracstep
