#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <span>
#include <string>

namespace diracstep {

/// Whether the force jumps where the motion crosses a kink: its values a little before and behind it do not
/// come together.  `velocity` is that at a time `later` behind it.  `reader` is an integrator of the scene,
/// whose motion stays as it is.
bool force_jumps(Integrator& reader, const KinkPassed& kink, double later, const Vector& velocity);

/// Follows a run whose steps are divided at the jumps of a force in q and v, by a method with a node at the
/// end of its steps: it takes the force of the other side there, for a whole part, so that its order is lost.
/// A method without such nodes, as GL(s) and the midpoint rule, is not looked at.
class JumpCheck {
 public:
  explicit JumpCheck(const Integrator& integrator);

  /// After each step, to where `end` is, over these kinks, read by an integrator of the same scene, which may
  /// be the same one.
  void after(std::span<const KinkPassed> kinks, const Integrator& end, Integrator& reader) {
    if (watched_ && !kinks.empty()) look(kinks, end, reader);
  }

  /// Empty, or a line that names the time of the first jump that was crossed.
  std::string text() const;

 private:
  void look(std::span<const KinkPassed> kinks, const Integrator& end, Integrator& reader);

  std::string method_;
  bool watched_;
  double time_;  ///< of the first jump; NaN before it
};

}  // namespace diracstep
