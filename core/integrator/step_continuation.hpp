#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/steps/step_problem.hpp>

namespace diracstep {

/// Follows the solution of a step from small step sizes up to the one wanted.
///
/// A step may have several solutions.  The one that approximates the motion is the one that is reached from
/// h → 0, where the mean velocity w(h) = (q1 − q0)/h tends to that at the start: |w(h) − v0| halves with h.
/// Newton's method from a poor guess may find another one, with a residual just as small.
class StepContinuation {
 public:
  StepContinuation(StepProblem& problem, NonlinearSolver& solver);

  /// The step to be followed, and the velocity at its start.
  struct Path {
    Interval step;
    const State& start;
    const StepMemory& memory;
    const Vector& v0;
  };

  struct Result {
    SolveReport report;  ///< of all solves together; ok where the whole step was reached
    long solves = 0;
    double reached = 0.0;  ///< the largest part of the step that could be solved, 0 … 1; 0 where no small
                           ///< step was found whose w tends to v0, be it for round-off: then nothing is known
  };

  /// Follows the solution into x, which holds one found otherwise.  Where the path ends early but that one
  /// moves as the path began to, the path is taken to have ended for round-off: nothing is known.
  Result follow(const Path& path, VectorRef x);

  /// Whether the mean velocity of a solution x and that of half the step tend to the velocity at the start.
  /// One solve; false also where that fails.
  bool tends_to_start(const Path& path, VectorRef x, Result& work);

  /// How far the ends of the steps with unknowns x and y are apart, in units of the way to the end of x.  The
  /// problem has begun.
  double distance(ConstVectorRef x, ConstVectorRef y);

 private:
  struct Point {
    double part = 0.0;  ///< of the step
    Vector x;
    double change = 0.0;  ///< |w − v0|
  };
  void begin(const Path& path, double part);
  bool solve(const Path& path, Point& point, Result& work);
  bool start(const Path& path, Result& work);
  double change(const Path& path, double h, ConstVectorRef x);

  StepProblem& problem_;
  NonlinearSolver& solver_;
  Point last_, before_, next_;
  StepEnd end_;
  Vector other_;
};

}  // namespace diracstep
