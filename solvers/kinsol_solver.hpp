#pragma once

#include <diracstep/core/nonlinear_solver.hpp>

namespace diracstep {

/// Settings of the Newton iteration; the defaults solve a step to round-off.
///
/// A residual row counts as zero below `tolerance` times the scale of its block.  Where round-off keeps it
/// above, a Newton step below `step_tolerance` of the unknowns ends the iteration, and the solution is
/// accepted if the residual is below `accept` times the scale; anything else is a failure.
struct KinsolOptions {
  double tolerance = 1e-15;
  double step_tolerance = 1e-9;
  double accept = 1e-11;
  int max_iterations = 20;
};

/// Solves nonlinear problems with SUNDIALS KINSOL: Newton's method with a fresh exact Jacobian in each
/// iteration, and once more with a line search where that fails.  Full patterns are factored densely, others
/// with KLU. The factory throws Misuse for a sparse problem where the library was built without KLU, and
/// std::runtime_error where SUNDIALS cannot set itself up.
SolverFactory kinsol(KinsolOptions options = {});

}  // namespace diracstep
