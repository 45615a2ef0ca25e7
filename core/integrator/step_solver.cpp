#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/integrator/step_solver.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <utility>

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
/// So many hard steps in a row are left to shorter ones.
constexpr int most_left = 4;

}  // namespace

StepSolver::StepSolver(std::unique_ptr<StepProblem> problem, const SolverFactory& solvers,
                       PointReader& reader)
    : problem_(std::move(problem)), reader_(&reader) {
  const StepTraits traits = problem_->traits();
  memory_.scales.setZero(traits.scales);
  memory_.multipliers.setZero(traits.multipliers);
  damped_ = traits.damped;
  if (problem_->size() == 0) return;
  solver_ = solvers(*problem_);
  continuation_ = std::make_unique<StepContinuation>(*problem_, *solver_);
}

void StepSolver::begin(const Task& task) { problem_->begin(task.step, task.start, memory_); }

/// Whether the system has one solution only.
bool StepSolver::affine() const { return !std::isnan(problem_->constant_jacobian_parameter()); }

SolveReport StepSolver::solve(const Task& task, Vector& x, Work& work) {
  const bool predicted = task.guess == Guess::predicted && task.predictor.ready();
  reached_ = 1.0;
  begin(task);
  SolveReport report;
  if (solver_) report = find(task, x, work);
  if (!report.ok()) return report;
  left_ = 0;
  problem_->finish(x, end_);
  if (predicted) prefer_smaller_turn(task, x, report, work);
  if (!(all_finite(end_.at.q.data(), end_.at.q.size()) && all_finite(end_.at.p.data(), end_.at.p.size())))
    report.status = SolveStatus::not_finite;
  return report;
}

/// One attempt at the system, counted and added up.
SolveReport StepSolver::attempt(VectorRef x, SolveReport& total, Work& work) {
  const SolveReport report = solver_->solve(x);
  work.count(report);
  total.add(report);
  return report;
}

/// The solution, from the guess asked for or with everything that can be tried.
SolveReport StepSolver::find(const Task& task, Vector& x, Work& work) {
  Guess guess = task.guess;
  if (guess == Guess::predicted && !task.predictor.ready()) guess = Guess::plain;
  if (guess == Guess::predicted)
    task.predictor.predict(x);
  else if (guess == Guess::plain)
    problem_->guess(task.start.v, x);
  if (damped_ && guess != Guess::last_solution) prefer_rest(task, x);
  guess_ = x;
  SolveReport report;
  (void)attempt(x, report, work);
  if (report.ok() && !doubtful(task, x, report, work)) return report;
  return rescue(task, guess, x, report, work);
}

/// A guess that velocities lead from may be where a diode would carry 1e30 A: Newton's method comes back from
/// there by 26 mV an iteration.  Where residuals are far beyond the sizes known before the step, and smaller
/// from rest, that is the guess; not where velocities are found from forces, which hardly change with the
/// voltage of a blocked diode, so that it would stay at rest.
void StepSolver::prefer_rest(const Task& task, Vector& x) {
  constexpr double beyond = 1e3;  // of these sizes
  if (affine() || reader_->velocity_by_forces()) return;
  std::array<double, 4> sizes{}, norms{};
  std::size_t count = 0;
  for (const ResidualBlock& block : problem_->blocks()) sizes.at(count++) = block.scale;
  residual_.resize(problem_->size());
  const auto excess = [&](const Vector& at) {
    problem_->residual(at, residual_);
    norms_of_blocks(problem_->blocks(), residual_.data(), norms);
    double largest = 0.0;
    for (std::size_t b = 0; b < count; ++b)
      if (const double part = norms.at(b) / sizes.at(b); !(part <= largest)) largest = part;
    return largest;
  };
  const double here = excess(x);
  if (here <= beyond) return;
  guess_.resize(x.size());
  problem_->guess(Vector::Zero(task.start.v.size()), guess_);
  if (!(excess(guess_) >= here)) x = guess_;
}

/// Whether a solution may be another than the one smaller steps lead to: the first one of a run where it does
/// not tend to the start as the step is halved, and any that Newton's method found far from its guess.
bool StepSolver::doubtful(const Task& task, const Vector& x, const SolveReport& report, Work& work) {
  if (affine() || damped_) return false;
  if (task.first) {
    start_velocity_ = task.start.v;
    if (!reader_->velocity(task.step.start, task.start.q, task.start.p, start_velocity_).ok()) return true;
    StepContinuation::Result halves;
    guess_ = x;
    const bool tends =
        continuation_->tends_to_start({task.step, task.start, memory_, start_velocity_}, guess_, halves);
    work.count(halves.report, halves.solves);
    return !tends;
  }
  const int others = report.iterations - report.jacobian_evaluations;
  return report.jacobian_evaluations + others / old_jacobian_iterations >= many_iterations &&
         continuation_->distance(x, guess_) > far_from_guess;
}

/// From a failed or doubtful solve on: the plain guess, the last solution, and at last the continuation,
/// which also decides whether a solution found so late is the right one.
SolveReport StepSolver::rescue(const Task& task, Guess guess, Vector& x, SolveReport total, Work& work) {
  if (!total.ok() && guess != Guess::plain) {
    ++work.retries.plain_guesses;
    problem_->guess(task.start.v, x);
    (void)attempt(x, total, work);
  }
  if (!total.ok() && guess == Guess::predicted) {
    ++work.retries.previous_solutions;
    x = task.predictor.last();
    (void)attempt(x, total, work);
  }
  if (damped_ && total.ok()) return total;
  if (leaves_hard_ && ++left_ <= most_left) return total;
  return follow(task, x, total, work);
}

SolveReport StepSolver::follow(const Task& task, Vector& x, SolveReport found, Work& work) {
  ++work.retries.continuations;
  start_velocity_ = task.start.v;
  if (!reader_->velocity(task.step.start, task.start.q, task.start.p, start_velocity_).ok())
    start_velocity_ = task.start.v;
  guess_ = x;
  const StepContinuation::Result path =
      continuation_->follow({task.step, task.start, memory_, start_velocity_}, guess_);
  work.count(path.report, path.solves);
  found.add_work(path.report);
  reached_ = path.reached;
  if (!path.report.ok()) {
    if (found.ok() && path.reached > 0.0) found.status = SolveStatus::other_branch;
    return found;
  }
  if (found.ok() && continuation_->distance(guess_, x) <= another_solution) return found;
  if (found.ok()) ++work.retries.other_branches;
  x = guess_;
  found.status = SolveStatus::ok;
  found.residual_norms = path.report.residual_norms;
  return found;
}

StepSolver::Turn StepSolver::turn(const Vector& v0) const {
  Turn turn{0.0, 0.0};
  for (Eigen::Index i = 0; i < v0.size(); ++i) {
    const double v = end_.at.v[i];
    turn.size = std::max(turn.size, std::abs(v - v0[i]));
    turn.speed = std::max(turn.speed, std::max(std::abs(v), std::abs(v0[i])));
  }
  return turn;
}

/// On a scene with rows a solution that turns sharply, far from where it was predicted, is solved again from
/// the guess along the last velocity; that solution is taken where it is another one that turns less.
void StepSolver::prefer_smaller_turn(const Task& task, Vector& x, SolveReport& total, Work& work) {
  if (!solver_ || damped_ || end_.impulse.size() == 0) return;
  const Turn found = turn(task.start.v);
  if (!(found.size > sharp_turn * found.speed) || affine()) return;
  if (continuation_->distance(x, guess_) <= far_from_guess) return;  // expected
  ++work.retries.plain_guesses;
  begin(task);  // with the sizes that round-off was judged by before the first solve
  problem_->guess(task.start.v, guess_);
  const bool solved = attempt(guess_, total, work).ok();
  total.status = SolveStatus::ok;
  if (solved && continuation_->distance(x, guess_) > another_solution) {
    problem_->finish(guess_, end_);
    if (turn(task.start.v).size < found.size) {
      ++work.retries.other_branches;
      x = guess_;
      return;
    }
  }
  problem_->finish(x, end_);
}

void StepSolver::clear_history() {
  memory_.known = false;
  memory_.scales.setZero();
  memory_.multipliers.setZero();
  drop_factors();
}

void StepSolver::drop_factors() {
  if (solver_) solver_->reset();
}

void StepSolver::take_over(const StepSolver& other) {
  memory_ = other.memory_;
  if (!solver_) return;
  Snapshot kept;
  other.solver_->save(kept);
  SnapshotReader from(kept);
  solver_->restore(from);
}

void StepSolver::save(Snapshot& to) const {
  to.section("step");
  to.put("memory known", memory_.known);
  to.put("scales", memory_.scales);
  to.put("multipliers", memory_.multipliers);
  if (!solver_) return;
  to.section("solver");
  solver_->save(to);
}

void StepSolver::restore(SnapshotReader& from) {
  from.section("step");
  memory_.known = from.flag("memory known");
  from.read("scales", memory_.scales);
  from.read("multipliers", memory_.multipliers);
  if (!solver_) return;
  from.section("solver");
  solver_->restore(from);
}

}  // namespace diracstep
