#pragma once

#include <diracstep/core/integrator/guess.hpp>
#include <diracstep/core/integrator/point_reader.hpp>
#include <diracstep/core/integrator/predictor.hpp>
#include <diracstep/core/integrator/step_continuation.hpp>
#include <diracstep/core/integrator/step_report.hpp>
#include <diracstep/core/steps/step_problem.hpp>
#include <memory>

namespace diracstep {

/// Solves one step: its problem, a solver, and what is done where Newton's method from the first guess fails
/// or may have found another solution than the one that smaller steps lead to (see StepReport).
///
/// A solve leaves no trace: the next one depends on the solves before it only where these were accepted. What
/// the solver keeps between solves (factors, pivots) changes round-off alone.
class StepSolver {
 public:
  /// A velocity that changes by more than this part of itself within a step turns sharply.
  static constexpr double sharp_turn = 0.5;

  /// The reader gives velocities to the continuation, and outlives the solver.
  StepSolver(std::unique_ptr<StepProblem> problem, const SolverFactory& solvers, PointReader& reader);

  struct Task {
    Interval step;
    const State& start;
    Predictor& predictor;
    Guess guess;
    bool first;  ///< no step before this one, so that its solution is to be compared with that of half of it
  };
  /// Into x the unknowns, into end() where they lead.  The work done is counted.
  SolveReport solve(const Task& task, Vector& x, Work& work);
  StepEnd& end() { return end_; }
  /// The part of the step that could be solved, where the last solve failed: 0 … 1; 1 where nothing is known.
  double reached() const { return reached_; }

  /// Steps from now on judge round-off by the step last solved.
  void accept_step() { memory_.swap(end_.memory); }
  /// No step was accepted before the next one, and nothing is kept.
  void clear_history();
  /// Drops what the solver keeps: pivots chosen for a matrix that led nowhere.
  void drop_factors();

  /// From now on a damping method fails at first where no guess leads to the solution: a shorter step is
  /// cheaper than following it from small steps on, in up to 100 solves.  That is done where a few steps in a
  /// row have failed.
  void leave_hard_steps() { leaves_hard_ = damped_; }

  /// Goes on from where another solver of the same step stands, with the same bits.
  void take_over(const StepSolver& other);

  void save(Snapshot& to) const;
  void restore(SnapshotReader& from);

  StepProblem& problem() { return *problem_; }
  const StepProblem& problem() const { return *problem_; }
  /// Null where the step is explicit.
  const NonlinearSolver* solver() const { return solver_.get(); }

 private:
  /// How the velocity changes from the start of the step to its mean.
  struct Turn {
    double size, speed;
  };

  void begin(const Task& task);
  SolveReport attempt(VectorRef x, SolveReport& total, Work& work);
  SolveReport find(const Task& task, Vector& x, Work& work);
  void prefer_rest(const Task& task, Vector& x);
  bool doubtful(const Task& task, const Vector& x, const SolveReport& report, Work& work);
  SolveReport rescue(const Task& task, Guess guess, Vector& x, SolveReport total, Work& work);
  SolveReport follow(const Task& task, Vector& x, SolveReport found, Work& work);
  Turn turn(const Vector& v0) const;
  void prefer_smaller_turn(const Task& task, Vector& x, SolveReport& total, Work& work);
  bool affine() const;

  std::unique_ptr<StepProblem> problem_;
  std::unique_ptr<NonlinearSolver> solver_;
  std::unique_ptr<StepContinuation> continuation_;
  PointReader* reader_;
  StepMemory memory_;
  StepEnd end_;
  bool damped_;  ///< see StepTraits
  bool leaves_hard_ = false;
  int left_ = 0;  ///< in a row
  double reached_ = 1.0;
  Vector guess_, start_velocity_, residual_;
};

}  // namespace diracstep
