#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <optional>
#include <span>
#include <string>

namespace diracstep {

/// The time of the first of these kinks, crossed on the way to where `end` is, at which the force jumps: its
/// values a little before and behind it do not come together.  `reader` is an integrator of the same scene,
/// which may be the same one; its motion stays as it is.
std::optional<double> jump_of_force(std::span<const KinkPassed> kinks, const Integrator& end,
                                    Integrator& reader);

/// Follows a run whose steps are divided at the jumps of a force in q and v, by a method with a node at the
/// end of its steps: it takes the force of the other side there, for a whole part, so that its order is lost.
/// A method without such nodes, as GL(s) and the midpoint rule, is not looked at.
class JumpCheck {
 public:
  explicit JumpCheck(const Integrator& integrator);

  /// After each step, with the arguments of jump_of_force().
  void after(std::span<const KinkPassed> kinks, const Integrator& end, Integrator& reader) {
    if (watched_ && !first_) first_ = jump_of_force(kinks, end, reader);
  }

  /// Empty, or a line that names the time of the first jump that was crossed.
  std::string text() const;

 private:
  std::string method_;
  bool watched_;
  std::optional<double> first_;  ///< time of the first jump
};

}  // namespace diracstep
