#pragma once

#include <array>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// Looks at windows of eight nodes that follow each other, one in 600 steps and at least three, for two
/// things that no step shows:
///
///  * a velocity, momentum or multiplier that alternates from node to node and does not die out: what is
///    damped faster than the step, such as the current of an inductor at a large resistor, comes back with
///    its sign reversed by methods that do not damp it;
///  * a momentum that stays while a force acts on it,  Σ|Δp_i| < 1e-3 Σ h |F_i|  with
///    F = ∂L/∂q + f + AᵀΛ, the largest of these left out: a frozen motion, whose forces have been taken for
///    round-off.  A body that is held still has such a force at its first node at most.
class NodeCheck {
 public:
  /// For a run of about so many steps; 0 where that is not known: windows then come less and less often.  The
  /// scene, a completed one, must outlive this.  Without `alternation` frozen momenta alone are looked for: a
  /// method that damps, with steps by their local error, has four of them in a turn of what it follows.
  NodeCheck(const Scene& scene, long steps, bool alternation = true);

  /// Whether the node after so many steps, counted by the caller, is to be shown; nodes are asked for in
  /// order.
  bool wants(long step) const { return step >= first_; }
  /// Node number `step` of the run, p projected.
  void see(long step, const Sample& node);

  /// Empty, or what was found first.
  const std::string& text() const { return text_; }

 private:
  static constexpr std::size_t window = 8;
  void judge();
  /// Changes by `rounding` are none.
  void look_for_alternation(const char* what, Vector Sample::*column, const std::vector<std::string>& names,
                            double rounding);
  void look_for_rest();
  void add_force(const Sample& node, Vector& force, Vector& terms, Vector& cancelling);

  const Scene& scene_;
  ConstraintsAtPoint rows_;
  bool growing_, alternation_;
  long between_, first_ = 0;
  std::size_t seen_ = 0;
  std::array<Sample, window> nodes_;
  std::string text_;
};

}  // namespace diracstep
