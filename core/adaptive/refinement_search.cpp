#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/refinement_search.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/frames.hpp>
#include <diracstep/core/runs/growth_check.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <optional>
#include <utility>

/// The runs of a RefinementSearch; what follows from them is in refinement_conclusions.cpp.
namespace diracstep::detail {

namespace {

// Of the ends of a step between whose kinks more parts are taken: in parts of the error, and at round-off.
constexpr double unresolved_allowed = 0.01, least_unresolved = 1e-11;
constexpr int max_failures = 12;  // of runs in a row
constexpr int most_stuck = 5;     // of them, of a motion that sticks at a kink: shorter steps do not free it
constexpr double steps_of_coarsest = 8.0;  // by their local error, at least
constexpr long fewest_steps = 4;           // of a run with variable steps that counts
constexpr long nodes_between_looks = 64;
constexpr std::size_t runs_kept = 3;
constexpr std::size_t runs_to_measure = 3;  // what a run to the error asked for would take
constexpr long energies_read = 100;         // of a run
constexpr int most_abandoned = 3;           // of runs in a row
constexpr long steps_for_a_rescue = 50;     // of a run that goes on

}  // namespace

RefinementSearch::RefinementSearch(const Motion& motion, ErrorControlReport& report, double first)
    : motion_(motion),
      report_(report),
      local_(report.adaptive && motion.registry.method(report.method).info.damped),
      convergence_(report.order, motion.options.error, !local_),
      first_(first),
      eps_step_(std::copysign(first, motion.end - motion.scene->start.time)),
      unit_(motion.options.first_step > 0.0 ? 1 : 2),
      refinement_(unit_),
      rest_(*motion.scene) {
  if (!report.adaptive)
    plan_ = StepPlan(known_stretches(*motion.scene, motion.end), first * static_cast<double>(unit_));
}

ErrorControlReport::Steps RefinementSearch::steps_of(long refinement) const {
  ErrorControlReport::Steps steps;
  steps.integrator = motion_.options.integrator;
  steps.integrator.method = report_.method;
  steps.integrator.order = report_.order;
  steps.integrator.compensated_sums = report_.compensated_sums;
  steps.refinement = refinement;
  if (report_.adaptive) {
    steps.integrator.step = eps_step_;
    steps.variable = {.eps = eps_of(refinement),
                      .control = motion_.options.control,
                      .monitor = motion_.options.monitor,
                      .scales = motion_.scales,
                      .end = motion_.end};
    // Steps that pass over what both they and their halves damp at once have no local error.
    if (local_)
      steps.variable.largest_step = std::abs(motion_.end - motion_.scene->start.time) *
                                    static_cast<double>(unit_) /
                                    (steps_of_coarsest * static_cast<double>(refinement));
  } else {
    steps.plan = plan_;
    steps.plan.allow_unresolved(std::max(unresolved_allowed * motion_.options.error, least_unresolved));
    steps.integrator.step = plan_.first_step(refinement);
  }
  return steps;
}

/// Whether the motion may cross kinks in q or v, at which the steps end.
bool RefinementSearch::kinks_on_the_way() const {
  return !report_.adaptive && motion_.scene->kinks && motion_.scene->kinks->count() > 0;
}

bool RefinementSearch::reached_end(double t) const {
  return std::abs(t - motion_.end) <= 1e-9 * std::abs(motion_.end - motion_.scene->start.time);
}

bool RefinementSearch::time_is_up() const {
  return std::chrono::duration<double>(Clock::now() - motion_.started).count() > motion_.options.max_time;
}

void RefinementSearch::count(ErrorControlRun& now, const Work& work) {
  now.steps = work.steps;
  now.solves = work.solves;
  report_.work.steps += work.steps;
  report_.work.solves += work.solves;
  report_.work.iterations += work.iterations;
  report_.work.residual_evaluations += work.residual_evaluations;
  report_.work.jacobian_evaluations += work.jacobian_evaluations;
}

/// Steps through the motion, and shows its points to the checks of a run and, where one is given, to a path.
/// Steps so long that they are not solved from their guesses, and have to be followed from short ones, cost
/// more than twice as many of half the size: a coarse run of such steps is given up.
RefinementSearch::Passed RefinementSearch::pass(long refinement, ErrorControlRun& now,
                                                std::vector<PathPoint>* path) {
  Passed passed;
  const ErrorControlReport::Steps steps = steps_of(refinement);
  now.step = report_.adaptive ? steps.variable.eps : std::abs(plan_.mean_step(refinement));
  long nodes = 0;
  SolveReport read_end;
  std::optional<NodeCheck> windows;
  EnergyCheck energy(*motion_.scene);
  const long between_energies = std::max(1L, plan_.steps() * refinement / energies_read);
  const bool may_give_up =
      !report_.adaptive && !kinks_on_the_way() && convergence_.runs() == 0 && failures_ < most_abandoned;
  const long rescues_allowed = 2 + plan_.steps() * refinement / steps_for_a_rescue;
  bool given_up = false;
  Sample node;
  const auto at_node = [&](const ReadNode& read, bool last) {
    if (!windows) windows.emplace(read.scene, 0);
    const bool wanted = windows->wants(nodes), looked_at = nodes % between_energies == 0;
    if ((path || (!last && (wanted || looked_at))) && read(Momentum::projected, node).ok()) {
      if (path) add_to_path(node, *path);
      if (!last && wanted) windows->see(nodes, node);
      if (!last && (wanted || looked_at)) {
        energy.see(node);
        see_sizes(node);
      }
    }
    if (last) read_end = read(Momentum::projected, passed.end);
    const Retries& retries = passed.work.retries;
    given_up = !last && may_give_up && retries.continuations + retries.divided_steps > rescues_allowed;
    if (given_up) return false;
    if (++nodes % nodes_between_looks != 0) return true;
    ended_ = motion_.options.go_on && !motion_.options.go_on();
    return !ended_ && !time_is_up() && report_.work.steps + nodes <= motion_.options.max_solves;
  };
  const StepsTaken done = run_steps_of(motion_.scene, motion_.registry, motion_.solvers, steps,
                                       report_.adaptive, motion_.end, passed.work, at_node);
  count(now, passed.work);
  const Sample& end = passed.end;
  now.failure = done.last.failure;
  if (given_up) now.failure = "given up: its steps are too long to be solved from their guesses";
  if (now.failure.empty() && end.q.size() == 0) {
    now.failure = ended_          ? "interrupted"
                  : read_end.ok() ? "not finished with the time or work allowed"
                                  : std::string("reading the end: ") + describe(read_end.status);
    passed.outcome = read_end.ok() ? Outcome::ended : Outcome::failed;
    return passed;
  }
  if (now.failure.empty() && !(end.q.allFinite() && end.p.allFinite())) now.failure = "the end is not finite";
  if (!now.failure.empty()) {
    passed.outcome = done.sticks ? Outcome::sticks : Outcome::failed;
    return passed;
  }
  energy.see(end);
  passed.doubt = joined_doubts({energy.denied(end, motion_.options.error, size_at_end(end.q, positions_),
                                              size_at_end(end.p, momenta_)),
                                energy.text(), windows ? windows->text() : std::string()});
  return passed;
}

double RefinementSearch::difference(const Sample& fine, const Sample& given) const {
  const Sample coarse = in_frames_of(fine.q, given, motion_.scene->space.get());
  return std::max({relative_change(fine.q, coarse.q, positions_), relative_change(fine.p, coarse.p, momenta_),
                   relative_change(fine.v, coarse.v, velocities_)});
}

RefinementSearch::Outcome RefinementSearch::run(long refinement) {
  ErrorControlRun& now = report_.runs.emplace_back();
  last_refinement_ = refinement;
  const bool first = convergence_.runs() == 0;
  std::vector<PathPoint> path;
  const bool shows_the_way = (first || report_.adaptive) && divisions_ == 0 && !local_;
  Passed passed = pass(refinement, now, shows_the_way ? &path : nullptr);
  if (passed.outcome != Outcome::counts) return passed.outcome;
  const long steps = passed.work.steps;
  if (report_.adaptive && (steps < fewest_steps || steps <= last_steps_)) {
    now.failure = steps < fewest_steps ? "too few steps to prove anything" : "no more steps than before";
    return Outcome::does_not_count;
  }
  last_steps_ = steps;
  doubt_ = std::move(passed.doubt);
  if (shows_the_way) path_ = std::move(path);
  if (first)
    coarsest_ = {refinement, steps, passed.end};
  else
    now.difference = difference(passed.end, report_.end);
  convergence_.add(local_ ? first_ / static_cast<double>(refinement) : now.step, now.difference,
                   round_off_of(steps));
  report_.end = passed.end;
  if (last_.size() == runs_kept) last_.erase(last_.begin());
  last_.push_back({refinement, steps, std::move(passed.end)});
  report_.step = report_.adaptive ? now.step : plan_.mean_step(refinement);
  report_.steps = steps_of(refinement);
  judge(now);
  return Outcome::counts;
}

/// The estimate for the last run.
void RefinementSearch::judge(ErrorControlRun& last) {
  report_.estimate = last.estimate = std::max(convergence_.estimate(), round_off_of(last_steps_));
  report_.observed_order = last.observed_order = convergence_.observed_order();
}

/// One run more with steps between those of two that count, where that may confirm the last: it takes less
/// than a finer one.
void RefinementSearch::confirm() {
  const std::size_t later = convergence_.confirmed_by_run_before();
  if (later == 0 || last_.size() <= later) return;
  const auto fine = last_.end() - static_cast<std::ptrdiff_t>(later), coarse = fine - 1;
  const long refinement =
      std::lround(std::sqrt(static_cast<double>(coarse->refinement) * static_cast<double>(fine->refinement)));
  if (refinement <= coarse->refinement || refinement >= fine->refinement) return;
  ErrorControlRun between;
  Passed passed = pass(refinement, between, nullptr);
  const long steps = passed.work.steps;
  const bool counts = passed.outcome == Outcome::counts && steps > coarse->steps && steps < fine->steps;
  if (counts) {
    between.difference = difference(passed.end, coarse->end);
    const double after = difference(fine->end, passed.end);
    convergence_.insert(later, local_ ? first_ / static_cast<double>(refinement) : between.step,
                        between.difference, after);
    if (later == 1) report_.runs.back().difference = after;
    last_.insert(fine, {refinement, steps, std::move(passed.end)});
    if (last_.size() > runs_kept) last_.erase(last_.begin());
  } else if (between.failure.empty()) {
    between.failure = "its number of steps is not between those of two runs";
  }
  report_.runs.insert(report_.runs.end() - 1, between);
  judge(report_.runs.back());
}

void RefinementSearch::begin_anew(long refinement) {
  convergence_.clear();
  last_.clear();
  report_.estimate = report_.observed_order = std::nan("");
  refinement_ = refinement;
  last_steps_ = 0;
  surveyed_ = false;
}

/// One run more; false where the search has come to its end.
bool RefinementSearch::next(long max_solves) {
  if (stopped(max_solves)) return false;
  switch (run(refinement_)) {
    case Outcome::ended:
      return !stopped(max_solves);
    case Outcome::sticks:
      if (++stuck_ == most_stuck)
        return refuse("the " + std::to_string(most_stuck) +
                      " finest of the runs end alike: " + report_.runs.back().failure);
      [[fallthrough]];
    case Outcome::failed:
      if (++failures_ > max_failures)
        return refuse("a run failed even with the step " + to_text(report_.runs.back().step, 3) + ": " +
                      report_.runs.back().failure);
      [[fallthrough]];
    case Outcome::does_not_count:
      refinement_ *= 2;
      return true;
    case Outcome::counts:
      failures_ = stuck_ = 0;
  }
  confirm();
  return (measuring_ && convergence_.runs() >= runs_to_measure) || conclude();
}

bool RefinementSearch::measure(long max_solves) {
  measuring_ = true;
  while (report_.refusal.empty() && convergence_.runs() < runs_to_measure)
    if (!next(std::min(max_solves, motion_.options.max_solves))) break;
  measuring_ = false;
  return convergence_.runs() >= runs_to_measure;
}

void RefinementSearch::go() {
  if (convergence_.runs() >= runs_to_measure && !conclude()) return;
  while (report_.refusal.empty() && !accepted_ && next(motion_.options.max_solves)) {
  }
}

/// The node of a run, and where a stretch ends the beginning of the next as well.
void RefinementSearch::add_to_path(const Sample& point, std::vector<PathPoint>& path) const {
  path.push_back({point.time, point.q, point.v, point.p});
  if (report_.adaptive) return;
  const auto& stretches = plan_.stretches();
  for (std::size_t k = 0; k + 1 < stretches.size(); ++k)
    if (std::abs(point.time - stretches[k].end) <= 1e-9 * std::abs(stretches[k].end - stretches[k].begin) &&
        stretches[k + 1].begin != point.time)
      path.push_back({stretches[k + 1].begin, point.q, point.v, point.p});
}

}  // namespace diracstep::detail
