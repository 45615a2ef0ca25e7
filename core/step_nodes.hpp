#pragma once

#include <span>

namespace diracstep {

/// A node c in [0,1] of a step and its weight.
struct StepNode {
  double c;
  double weight;
};

/// The one- and two-point rules that make a discrete Lagrangian out of L and discrete constraint rows out of
/// one-forms.  Left and right are of order 1, midpoint and trapezoidal of order 2.
enum class StepRule { left, right, midpoint, trapezoidal };

/// Nodes and weights of a rule; the weights add up to 1.
std::span<const StepNode> step_nodes(StepRule rule);

/// The rule of the adjoint step: left and right change places.
StepRule mirrored(StepRule rule);

/// "left", "right", "midpoint" or "trapezoidal".
const char* name(StepRule rule);

}  // namespace diracstep
