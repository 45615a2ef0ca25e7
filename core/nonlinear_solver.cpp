#include <diracstep/core/nonlinear_solver.hpp>
#include <limits>

namespace diracstep {

double NonlinearProblem::constant_jacobian_parameter() const {
  return std::numeric_limits<double>::quiet_NaN();
}

const char* describe(SolveStatus status) {
  switch (status) {
    case SolveStatus::ok:
      return "ok";
    case SolveStatus::no_convergence:
      return "no convergence";
    case SolveStatus::singular_jacobian:
      return "singular Jacobian";
    case SolveStatus::not_finite:
      return "a value was not finite";
  }
  return "unknown status";
}

}  // namespace diracstep
