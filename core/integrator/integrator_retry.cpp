#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/scales.hpp>

namespace diracstep {

namespace {

/// A solution is looked at twice after so many Newton iterations, where it lies so far from its guess in
/// units of the way of the step.
constexpr int many_iterations = 5;
/// With an old Jacobian, or with none, so many iterations gain what one of Newton's method does.
constexpr int old_jacobian_iterations = 3;
constexpr double far_from_guess = 0.1;
/// Solutions so far apart are different ones.
constexpr double another_solution = 1e-6;
/// A velocity that changes by more than this part of itself within a step turns sharply.
constexpr double sharp_turn = 0.5;

}  // namespace

/// One more attempt at a system, counted and added up.
SolveReport Integrator::solve(Part& part, Vector& x, SolveReport& total) {
  const SolveReport report = part.solver->solve(x);
  count(report);
  total.add(report);
  return report;
}

/// Whether a solution may be another than the one smaller steps lead to: the first one of a run where it does
/// not tend to the start as the step is halved, and any that Newton's method found far from its guess.
bool Integrator::doubtful(const Stage& stage, Interval step, const Vector& q, const Vector& p,
                          const SolveReport& report) {
  Part& part = parts_[stage.part];
  if (!std::isnan(part.problem->constant_jacobian_parameter())) return false;  // affine: one solution
  if (!on_a_motion_ && !stage.predictor.begun() && &stage == &stages_.front()) {
    StepContinuation::Result work;
    if (!project_velocity(step.start, q, p, start_velocity_).ok()) return true;
    guess_ = stage.solution;
    const bool tends = part.continuation->tends_to_start(step, q, p, start_velocity_, guess_, work);
    count(work.report, work.solves);
    return !tends;
  }
  const int others = report.iterations - report.jacobian_evaluations;
  return report.jacobian_evaluations + others / old_jacobian_iterations >= many_iterations &&
         part.continuation->distance(q, stage.solution, guess_) > far_from_guess;
}

/// From a failed or doubtful solve on: the plain guess, the last solution, and at last the continuation,
/// which also decides whether a solution found so late is the right one.
SolveReport Integrator::retry_stage(Stage& stage, Interval step, const Vector& q, const Vector& p,
                                    Guess guess, SolveReport total) {
  Part& part = parts_[stage.part];
  if (!total.ok() && guess != Guess::plain) {
    ++work_.retries.plain_guesses;
    part.problem->guess(v_, stage.solution);
    (void)solve(part, stage.solution, total);
  }
  if (!total.ok() && guess == Guess::predicted) {
    ++work_.retries.previous_solutions;
    stage.solution = stage.predictor.last();
    (void)solve(part, stage.solution, total);
  }
  return follow_stage(stage, step, q, p, total);
}

SolveReport Integrator::follow_stage(Stage& stage, Interval step, const Vector& q, const Vector& p,
                                     SolveReport found) {
  Part& part = parts_[stage.part];
  ++work_.retries.continuations;
  if (!project_velocity(step.start, q, p, start_velocity_).ok()) start_velocity_ = v_;
  guess_ = stage.solution;
  const StepContinuation::Result path = part.continuation->follow(step, q, p, start_velocity_, guess_);
  count(path.report, path.solves);
  found.add_work(path.report);
  reached_ = path.reached;
  if (!path.report.ok()) {
    if (found.ok() && path.reached > 0.0) found.status = SolveStatus::other_branch;
    return found;
  }
  if (found.ok() && part.continuation->distance(q, guess_, stage.solution) <= another_solution) return found;
  if (found.ok()) ++work_.retries.other_branches;
  stage.solution = guess_;
  found.status = SolveStatus::ok;
  found.residual_norms = path.report.residual_norms;
  return found;
}

Integrator::Turn Integrator::turn(const Vector& q, double h) const {
  Turn turn{0.0, 0.0};
  for (Eigen::Index i = 0; i < v_.size(); ++i) {
    const double v = (q_next_[i] - q[i]) / h;
    turn.size = std::max(turn.size, std::abs(v - v_[i]));
    turn.speed = std::max(turn.speed, std::max(std::abs(v), std::abs(v_[i])));
  }
  return turn;
}

/// A solved stage that turns sharply, far from where it was predicted, is solved again from the guess along
/// the last velocity; that solution is taken where it is another one that turns less.  The problem begins
/// anew for it, since the first solve may have been done by another integrator, before a snapshot.
void Integrator::prefer_smaller_turn(Stage& stage, Interval step, const Vector& q, const Vector& p,
                                  SolveReport& total) {
  Part& part = parts_[stage.part];
  const Turn found = turn(q, step.size);
  if (!part.solver || !(found.size > sharp_turn * found.speed)) return;
  if (!std::isnan(part.problem->constant_jacobian_parameter())) return;  // affine: one solution
  if (part.continuation->distance(q, stage.solution, guess_) <= far_from_guess) return;  // expected
  ++work_.retries.plain_guesses;
  part.problem->begin(step, q, p);
  part.problem->guess(v_, guess_);
  const bool solved = solve(part, guess_, total).ok();
  total.status = SolveStatus::ok;
  if (solved && part.continuation->distance(q, stage.solution, guess_) > another_solution) {
    part.problem->finish(guess_, q_next_, p_next_, impulse_);
    if (turn(q, step.size).size < found.size) {
      ++work_.retries.other_branches;
      stage.solution = guess_;
      return;
    }
  }
  part.problem->finish(stage.solution, q_next_, p_next_, impulse_);
}

}  // namespace diracstep
