#pragma once

#include <diracstep/boundary_values/detail/controlled_force.hpp>
#include <diracstep/boundary_values/detail/motion_equations.hpp>
#include <diracstep/boundary_values/optimal_control.hpp>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace diracstep::boundary {

/// An optimal control problem as a nonlinear program: min f(u) where r(u) = 0, between bounds, with u of
/// MotionEquations, the controls behind.
class ControlProgram {
 public:
  explicit ControlProgram(const ControlProblem& problem);

  int unknowns() const { return static_cast<int>(start_.size()); }
  int equations() const { return equations_; }
  const Vector& start() const { return start_; }
  const Vector& lower() const { return lower_; }
  const Vector& upper() const { return upper_; }

  double cost(const Vector& u);
  Vector gradient(const Vector& u);
  Vector residual(const Vector& u);
  Sparse jacobian(const Vector& u);

  /// (row, column) of the lower half of the second derivatives of `factor`·f + λ·r, and their values: by
  /// forward differences of its gradient.  An equation of a step is linear in all but the unknowns of that
  /// step, so that one unknown of every step can be moved at a time.
  std::vector<std::pair<int, int>> hessian_entries() const;
  Vector hessian(const Vector& u, double factor, const Vector& multipliers);

  /// The motion, the controls, and what the integrator makes of them.
  void describe(const Vector& u, OptimalControlReport& report);

 private:
  void place_bounds();
  void fill_controls();
  void group_unknowns();
  struct End {
    double t;
    Vector q, v;
  };
  End end(const Vector& u) const;
  int cost_at() const;
  double difference_of_run(const Vector& u);

  const ControlProblem& problem_;
  int n_, count_;  ///< coordinates of the scene; numbers of the controls in a step
  std::shared_ptr<ControlsInUse> in_use_;
  std::unique_ptr<Integrator> integrator_;
  std::unique_ptr<MotionEquations> motion_;
  BoundaryConditions all_conditions_;
  int equations_ = 0;
  Vector start_, lower_, upper_;
  std::vector<std::vector<int>> groups_;  ///< the unknowns of each step, and of the end
};

struct InteriorPointReport {
  bool converged = false;
  bool interrupted = false;
  std::string ending;
  int iterations = 0;
};

/// Ipopt from program.start() on; u is its last iterate; `go_on`, where there is one, is asked after each
/// iteration.  Throws Misuse where the library has none.
InteriorPointReport solve(ControlProgram& program, int max_iterations, double tolerance,
                          const std::function<bool()>& go_on, Vector& u);

}  // namespace diracstep::boundary
