#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/step_continuation.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <limits>
#include <utility>

namespace diracstep {

namespace {

constexpr double first_part = 1.0 / 2.0;
constexpr int max_halvings = 24;  ///< of the first part
/// A point of the path has to be found in so many iterations or so near its guess, in units of the way from
/// the last point, else the way to it is halved.
constexpr int max_iterations = 6;
constexpr double near_guess = 0.25;
/// The path ends where a stride would be shorter than this part of what lies behind.
constexpr double shortest_stride = 1.0 / 64.0;
constexpr long max_solves = 100;
/// Of |w(h/2) − v0| to |w(h) − v0|: 1/2 as h → 0, less where the acceleration vanishes at the start.
constexpr double largest_ratio = 0.75;
/// Below this part of the velocities involved |w − v0| is round-off.
constexpr double round_off = 1e-9;
/// … and below this part of q/h.
constexpr double rounded_positions = 16.0 * std::numeric_limits<double>::epsilon();

}  // namespace

StepContinuation::StepContinuation(StepProblem& problem, NonlinearSolver& solver)
    : problem_(problem), solver_(solver) {
  before_.x.setZero(problem.size());
}

void StepContinuation::begin(const Path& path, double part) {
  problem_.begin({path.step.start, part * path.step.size}, path.start, path.memory);
}

double StepContinuation::change(const Path& path, double h, ConstVectorRef x) {
  problem_.finish(x, end_);
  const double floor = std::max(round_off * (max_norm(end_.v) + max_norm(path.v0)),
                                rounded_positions * max_norm(path.start.q) / std::abs(h));
  other_ = end_.v - path.v0;
  const double norm = max_norm(other_);
  return norm > floor ? norm : 0.0;
}

/// Solves the part of the step that has begun, from the guess in `point`.
bool StepContinuation::solve(const Path& path, Point& point, Result& work) {
  const SolveReport report = solver_.solve(point.x);
  ++work.solves;
  work.report.add(report);
  if (!report.ok()) return false;
  point.change = change(path, point.part * path.step.size, point.x);
  work.reached = std::max(work.reached, point.part);
  return true;
}

/// Two points, one half as far as the other, from which on w tends to v0.
bool StepContinuation::start(const Path& path, Result& work) {
  for (Point* point : {&last_, &next_}) point->x.resize(problem_.size());  // few scenes ever come here
  bool found = false;
  double part = first_part;
  for (int k = 0; k <= max_halvings; ++k, part /= 2.0) {
    next_.part = part;
    begin(path, part);
    problem_.guess(path.v0, next_.x);
    const int before = work.report.iterations;
    const bool solved = solve(path, next_, work) && work.report.iterations - before <= max_iterations;
    if (solved && found && last_.change > 0.0 && next_.change <= largest_ratio * last_.change) {
      std::swap(before_, next_);
      return true;
    }
    found = solved;
    if (solved) std::swap(last_, next_);
  }
  return false;
}

StepContinuation::Result StepContinuation::follow(const Path& path, VectorRef x) {
  Result work;
  bool going = start(path, work);
  work.reached = going ? last_.part : 0.0;
  double stride = last_.part;
  while (going && last_.part < 1.0) {
    next_.part = std::min(1.0, last_.part + stride);
    const double ahead = (next_.part - last_.part) / (last_.part - before_.part);
    next_.x = last_.x + ahead * (last_.x - before_.x);
    begin(path, next_.part);
    const int before = work.report.iterations;
    const bool solved = solve(path, next_, work);
    const double missed = (next_.x - last_.x - ahead * (last_.x - before_.x)).lpNorm<Eigen::Infinity>();
    const double way = (next_.x - last_.x).lpNorm<Eigen::Infinity>();
    if (solved && (work.report.iterations - before <= max_iterations || missed <= near_guess * way)) {
      std::swap(before_, last_);
      std::swap(last_, next_);
      stride *= 2.0;
    } else {
      stride /= 2.0;
      going = stride >= shortest_stride * last_.part && work.solves < max_solves;
    }
  }
  begin(path, 1.0);
  if (going) {
    x = last_.x;
    return work;
  }
  if (work.report.ok()) work.report.status = SolveStatus::no_convergence;
  const double expected = last_.change / last_.part;  // |w − v0| of the whole step, if it grew as it began to
  if (work.reached > 0.0 && std::abs(change(path, path.step.size, x) - expected) <= expected / 2.0)
    work.reached = 0.0;
  return work;
}

bool StepContinuation::tends_to_start(const Path& path, VectorRef x, Result& work) {
  const double whole = change(path, path.step.size, x);
  before_.part = 0.5;
  begin(path, before_.part);
  problem_.guess(path.v0, before_.x);
  const bool solved = solve(path, before_, work);
  begin(path, 1.0);
  return solved && before_.change <= largest_ratio * whole;
}

double StepContinuation::distance(ConstVectorRef x, ConstVectorRef y) {
  problem_.finish(y, end_);
  other_ = end_.v;
  problem_.finish(x, end_);
  const double way = end_.v.lpNorm<Eigen::Infinity>();
  other_ -= end_.v;
  const double apart = other_.lpNorm<Eigen::Infinity>();
  return apart > 0.0 ? apart / way : 0.0;
}

}  // namespace diracstep
