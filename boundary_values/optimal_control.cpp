#include <cmath>
#include <diracstep/boundary_values/detail/control_program.hpp>
#include <diracstep/boundary_values/optimal_control.hpp>

namespace diracstep {

bool optimal_control_available() {
#ifdef DIRACSTEP_WITH_IPOPT
  return true;
#else
  return false;
#endif
}

OptimalControlReport solve_optimal_control(const ControlProblem& problem) {
  boundary::ControlProgram program(problem);
  Vector u = program.start();
  const boundary::InteriorPointReport search =
      boundary::solve(program, problem.max_iterations, problem.tolerance, problem.go_on, u);
  OptimalControlReport report;
  report.iterations = search.iterations;
  program.describe(u, report);
  const double size = std::max(1.0, report.q.lpNorm<Eigen::Infinity>());
  report.converged = search.converged && report.residual <= 1e-6 * size;
  report.ending = search.converged && !report.converged
                      ? "a condition that was taken to follow from the rows and other conditions does not: " +
                            std::to_string(report.residual)
                      : search.ending;
  return report;
}

}  // namespace diracstep
