#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <string>

namespace diracstep {

/// What one step did.  A failed step leaves the state as it was, bit by bit; only the work done counts.
///
/// A system that Newton's method from the predicted guess does not solve is tried with a line search, from
/// the plain guess, from the last solution, and by following the solution from small step sizes on
/// (step_continuation.hpp); then, where the options allow it, the step is taken in smaller ones.  A solution
/// far from its guess, or the first of a run, is compared with the one that smaller steps lead to, which is
/// taken where it is another.  On a scene with rows, a solution that turns the velocity sharply is compared
/// with the one found from a guess straight on, which is taken where it turns less: where rows come near to
/// depending on each other, motions branch, and Newton's method may end on another branch.
struct [[nodiscard]] StepReport {
  SolveReport solve;
  long step = 0;        ///< number of the step, from 0
  double time = 0.0;    ///< where it started
  std::string failure;  ///< empty, or what went wrong and where, with the residual of each block

  bool ok() const { return solve.ok(); }
};

/// How often a step needed more than Newton's method from its first guess.
struct Retries {
  long line_searches = 0;       ///< attempts of the solver with a line search
  long plain_guesses = 0;       ///< solves from the plain guess after the predicted one failed
  long previous_solutions = 0;  ///< solves from the last solution after that
  long continuations = 0;       ///< solutions followed from small step sizes on
  long other_branches = 0;      ///< … that were not the solution found before
  long divided_steps = 0;       ///< steps taken in smaller ones

  long total() const {
    return line_searches + plain_guesses + previous_solutions + continuations + divided_steps;
  }
};

/// Work done since the start.  Reading points is not counted.
struct Work {
  long steps = 0;
  long solves = 0;
  long iterations = 0;
  long residual_evaluations = 0;
  long jacobian_evaluations = 0;
  Retries retries;

  /// Adds the work of another integrator, whose steps count as well.
  void add(const Work& other) {
    steps += other.steps;
    solves += other.solves;
    iterations += other.iterations;
    residual_evaluations += other.residual_evaluations;
    jacobian_evaluations += other.jacobian_evaluations;
    retries.line_searches += other.retries.line_searches;
    retries.plain_guesses += other.retries.plain_guesses;
    retries.previous_solutions += other.retries.previous_solutions;
    retries.continuations += other.retries.continuations;
    retries.other_branches += other.retries.other_branches;
    retries.divided_steps += other.retries.divided_steps;
  }

  void count(const SolveReport& report, long new_solves = 1) {
    solves += new_solves;
    retries.line_searches += report.line_searches;
    iterations += report.iterations;
    residual_evaluations += report.residual_evaluations;
    jacobian_evaluations += report.jacobian_evaluations;
  }
};

}  // namespace diracstep
