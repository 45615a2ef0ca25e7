#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/solvers/kinsol_options.hpp>

namespace diracstep {

/// Solves nonlinear problems with SUNDIALS KINSOL: Newton's method with exact Jacobians, once more with a
/// line search where that fails, and by short steps where that meets values that are not finite.  Full
/// patterns are factored densely, others with KLU, or with full matrices and Eigen's sparse LU where the
/// library was built without it.  The factory throws Error where SUNDIALS cannot set itself up.
SolverFactory kinsol(KinsolOptions options = {});

}  // namespace diracstep
