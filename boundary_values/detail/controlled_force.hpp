#pragma once

#include <diracstep/boundary_values/optimal_control.hpp>
#include <diracstep/core/dirac/generating_function.hpp>

namespace diracstep::boundary {

/// The controls of the step that is looked at: a polynomial by its values at `points` of the step, all P of
/// one point after those of the other.
struct ControlsInUse {
  Interval step{0.0, 1.0};
  Vector points;  ///< in parts of the step
  Vector values;
};

/// Points of a polynomial of this degree in a step: Lobatto's, the middle for a constant.
Vector control_points(int degree);

/// The force on (q, c), where c is the coordinate whose momentum is the cost so far; and on (q, c, values of
/// the controls), whose derivatives by these the steps are differentiated with.  Reads `in_use`, which its
/// owner changes from step to step: not for several threads.
std::shared_ptr<const Force> controlled_force(const ControlledScene& controlled,
                                              std::shared_ptr<const ControlsInUse> in_use, bool extended);

}  // namespace diracstep::boundary
