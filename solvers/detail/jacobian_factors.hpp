#pragma once

#include <algorithm>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/solvers/detail/linear_solver.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <memory>
#include <vector>

namespace diracstep::detail {

/// The factors of a problem's Jacobian, and the decision when to make new ones.
class JacobianFactors {
 public:
  JacobianFactors(NonlinearProblem& problem, JacobianPolicy policy);

  enum class Outcome { ready, singular, not_finite };

  /// A solve begins: a Jacobian of an earlier point may now be taken for one of this solve.
  void begin();
  /// Factors that serve for a Newton step at x, new or old ones; `norm` is the scaled residual at x.
  Outcome prepare(ConstVectorRef x, double norm);
  /// Replaces b by the solution.
  void solve(double* b) { current_->solver->solve(b); }

  /// Jacobians taken since begin().
  int evaluations() const { return evaluations_; }
  /// Whether Newton's method converges quadratically with these factors.
  bool exact() const { return policy_ == JacobianPolicy::fresh || constant_; }
  /// How small beside the unknowns a correction is that ends Newton's method, where `asked` ends it with
  /// exact factors or with those of its own point.  With a Jacobian of another point the error falls by a
  /// mere factor in each iteration, so that the last correction has to be small itself.
  double step_tolerance(double asked) const { return exact() || current() ? asked : std::min(asked, 1e-14); }
  /// Whether the last iteration took a Jacobian of its own point.
  bool current() const { return current_point_; }
  /// Drops every factor and pivot.
  void reset();
  /// Writes and reads all that the next solves depend on, old factors among it.
  void save(Snapshot& to) const;
  void restore(SnapshotReader& from);

  const char* name() const { return factors_.front().solver->name(); }
  std::string policy() const;

 private:
  struct Factors {
    double parameter;  ///< of a constant Jacobian; NaN for none
    std::unique_ptr<LinearSolver> solver;
    Vector values;          ///< of the Jacobian factored last; empty before the first
    bool factored = false;  ///< since reset()
    bool usable = false;    ///< and not singular
  };

  bool wanted(double norm);
  bool select(double parameter);
  Factors& add();
  bool keeps_factors() const { return constant_ || policy_ != JacobianPolicy::fresh; }

  NonlinearProblem& problem_;
  JacobianPolicy policy_;
  bool constant_ = false;
  std::vector<Factors> factors_;  ///< one for each parameter of a constant Jacobian, else a single one
  Factors* current_;              ///< one of them, which never move
  double last_norm_ = 0.0;
  int evaluations_ = 0, iterations_ = 0;
  int fresh_starts_ = 0;  ///< so many solves more begin with a new Jacobian, since an old one failed
  bool current_point_ = false;
};

}  // namespace diracstep::detail
