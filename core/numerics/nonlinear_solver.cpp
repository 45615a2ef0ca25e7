#include <diracstep/core/numerics/nonlinear_solver.hpp>
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
    case SolveStatus::other_branch:
      return "the solution found is not the one that smaller steps lead to";
    case SolveStatus::refused:
      return "refused before it was solved";
  }
  return "unknown status";
}

}  // namespace diracstep
