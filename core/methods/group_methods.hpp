#pragma once

#include <diracstep/core/methods/method.hpp>

namespace diracstep {

/// The steps of a method whose discrete Lagrangian is a quadrature at the ends, by its rule for the rows,
/// left, right or trapezoidal: those given in R^n, and on a configuration space of its own the same near the
/// diagonal (steps/groups/quadrature_step.hpp), for types 2 and 3 as well.
StepFactory with_group_step(const MethodInfo& info, StepFactory in_flat_space);

/// The steps of a Legendre transform or an adjoint: those given in R^n, and on a configuration space of its
/// own those of the method that steps the same there.  There is none of type 4, which is refused.
StepFactory with_group_step_of(const MethodInfo& info, StepFactory in_flat_space, StepFactory on_group);

}  // namespace diracstep
