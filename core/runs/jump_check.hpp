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

/// Follows a run whose steps are divided at the jumps of a force in q and v, by a composition of an order
/// above that of its method and 2: some of its steps go back, so that the others go over the end of a part
/// and take the force of the other side there.  What stays within its steps keeps its order and is not looked
/// at, nor are compositions of the midpoint rule, whose nodes stay within.
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
