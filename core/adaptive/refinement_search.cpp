#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/end_errors.hpp>
#include <diracstep/core/adaptive/refinement_search.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/growth_check.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <utility>

namespace diracstep::detail {

namespace {

constexpr int max_failures = 12;  // of runs in a row
constexpr int max_divisions = 6;
constexpr std::size_t max_runs = 60;
constexpr std::size_t runs_to_converge = 8, runs_to_resolve_kinks = 24;  // before stagnation counts
constexpr long fewest_steps = 4;              // of a run with variable steps that counts
constexpr double missed_allowed = 0.1;        // by the forces surveyed, in parts of the error asked for
constexpr double error_out_of_reach = 1e-15;  // differences of runs hold nothing but round-off below it
constexpr long nodes_between_looks = 64;
constexpr std::size_t runs_kept = 3;
constexpr std::size_t runs_to_measure = 3;      // what a run to the error asked for would take
constexpr long energies_read = 100;             // of a run
constexpr double growth_of_no_power = 1e6;      // of two runs apart: powers of the time lead to less
constexpr double smallest_local_error = 2e-14;  // below it steps have one of round-off
constexpr int most_abandoned = 3;               // of runs in a row
constexpr long steps_for_a_rescue = 50;         // of a run that goes on

std::string text(double value) { return to_text(value, 3); }

/// Explicit steps solve nothing.
long effort(const ErrorControlRun& run) { return std::max(run.solves, run.steps); }

}  // namespace

RefinementSearch::RefinementSearch(const Motion& motion, ErrorControlReport& report, double first)
    : motion_(motion),
      report_(report),
      convergence_(report.order, motion.options.error),
      local_(report.adaptive && motion.registry.method(report.method).info.damped),
      first_(first),
      eps_step_(std::copysign(first, motion.end - motion.scene->start.time)),
      unit_(motion.options.first_step > 0.0 ? 1 : 2),
      refinement_(unit_) {
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
  } else {
    steps.plan = plan_;
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

/// Whether there will be no further run, which is then told.
bool RefinementSearch::stopped(long max_solves) {
  double expected = static_cast<double>(std::max(report_.work.solves, report_.work.steps));
  if (!report_.runs.empty()) {
    const ErrorControlRun& last = report_.runs.back();
    expected += static_cast<double>(effort(last) * refinement_) / static_cast<double>(last_refinement_);
  } else if (!report_.adaptive) {
    expected += static_cast<double>(plan_.steps() * refinement_);
  }
  const double limit = static_cast<double>(max_solves);
  const double needed = predicted_solves();
  // Until the steps resolve a contact the runs go different ways, and their differences foretell nothing.
  const bool unresolved = kinks_on_the_way() && convergence_.better_order() < 0.5 * report_.order;
  if (ended_ || (motion_.options.go_on && !motion_.options.go_on()))
    refuse("interrupted");
  else if (time_is_up())
    refuse("the time of " + text(motion_.options.max_time) + " s is used up (--max-time)");
  else if (expected > limit)
    refuse("the next run would bring the work to " + text(expected) +
           " nonlinear systems or explicit steps (--max-solves)");
  else if (local_ && eps_of(refinement_) < smallest_local_error)
    refuse("steps with local errors below " + text(smallest_local_error) +
           " would follow nothing but round-off");
  else if (convergence_.runs() >= 5 && needed > limit && convergence_.difference() < error_out_of_reach)
    refuse_unless_amplified(convergence_.obstacle());
  else if (convergence_.runs() >= 5 && needed > limit && !convergence_.near_round_off() && !unresolved)
    refuse_unless_amplified("at the rate of the runs so far it would take about " + text(needed) +
                            " nonlinear systems or explicit steps (--max-solves)");
  else if (report_.runs.size() >= max_runs)
    refuse("no convergence in " + std::to_string(max_runs) + " runs");
  else
    return false;
  return true;
}

double RefinementSearch::predicted_solves() const {
  if (report_.runs.empty()) return 0.0;
  return convergence_.work_to_go() * static_cast<double>(effort(report_.runs.back()));
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
  NodeCheck windows(*motion_.scene, 0);
  EnergyCheck energy(*motion_.scene);
  const long between_energies = std::max(1L, plan_.steps() * refinement / energies_read);
  const bool may_give_up =
      !report_.adaptive && !kinks_on_the_way() && convergence_.runs() == 0 && failures_ < most_abandoned;
  const long rescues_allowed = 2 + plan_.steps() * refinement / steps_for_a_rescue;
  bool given_up = false;
  Sample node;
  const auto at_node = [&](const ReadNode& read, bool last) {
    const bool wanted = windows.wants(nodes), looked_at = nodes % between_energies == 0;
    if ((path || (!last && (wanted || looked_at))) && read(Momentum::projected, node).ok()) {
      if (path) add_to_path(node, *path);
      if (!last && wanted) windows.see(nodes, node);
      if (!last && (wanted || looked_at)) {
        energy.see(node);
        largest_position_ = std::max(largest_position_, max_norm(node.q));
        largest_momentum_ = std::max(largest_momentum_, max_norm(node.p));
        largest_velocity_ = std::max(largest_velocity_, max_norm(node.v));
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
  const StepReport done = run_steps_of(motion_.scene, motion_.registry, motion_.solvers, steps,
                                       report_.adaptive, motion_.end, passed.work, at_node);
  count(now, passed.work);
  const Sample& end = passed.end;
  now.failure = done.failure;
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
    passed.outcome = Outcome::failed;
    return passed;
  }
  energy.see(end);
  passed.doubt =
      joined_doubts({energy.denied(end, motion_.options.error, size_at_end(end.q, largest_position_),
                                   size_at_end(end.p, largest_momentum_)),
                     energy.text(), windows.text()});
  return passed;
}

double RefinementSearch::difference(const Sample& fine, const Sample& coarse) const {
  return std::max({relative_change(fine.q, coarse.q, largest_position_),
                   relative_change(fine.p, coarse.p, largest_momentum_),
                   relative_change(fine.v, coarse.v, largest_velocity_)});
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
  convergence_.add(local_ ? first_ / static_cast<double>(refinement) : now.step, now.difference);
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

/// Begins anew with compensated sums where round-off shows without them.
bool RefinementSearch::compensate() {
  if (!motion_.may_compensate || report_.compensated_sums || !convergence_.near_round_off()) return false;
  report_.compensated_sums = true;
  begin_anew(std::max(unit_, refinement_ / 4));
  return true;
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
    case Outcome::failed:
      if (++failures_ > max_failures)
        return refuse("a run failed even with the step " + text(report_.runs.back().step) + ": " +
                      report_.runs.back().failure);
      [[fallthrough]];
    case Outcome::does_not_count:
      refinement_ *= 2;
      return true;
    case Outcome::counts:
      failures_ = 0;
  }
  confirm();
  return (measuring_ && convergence_.runs() >= runs_to_measure) || conclude();
}

/// What follows from the runs so far: their last is accepted, a finer one is to come, or the search ends,
/// for which false stands.
bool RefinementSearch::conclude() {
  if (convergence_.accepted()) {
    if (!survey(true)) return report_.refusal.empty();
    return accept();
  }
  // Runs that do not follow the motion yet cross the kinks in other places than it does.
  if (convergence_.runs() >= 4 && !convergence_.order_confirmed() && !surveyed_ && !kinks_on_the_way() &&
      !survey(false))
    return report_.refusal.empty();
  if (compensate()) return true;
  const std::size_t patience = kinks_on_the_way() ? runs_to_resolve_kinks : runs_to_converge;
  if (convergence_.stagnates() && (convergence_.runs() > patience || convergence_.difference() < 1e-4))
    return refuse_unless_amplified(convergence_.obstacle());
  const double next = static_cast<double>(refinement_) / convergence_.next_factor();
  refinement_ = std::max(refinement_ + 1, std::lround(next));
  return true;
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

/// Points of a run that got to the end, for the survey: the run again, with its nodes read.
std::vector<PathPoint> RefinementSearch::path_of(long refinement) {
  std::vector<PathPoint> path;
  Work work;
  Sample point;
  const auto at_node = [&](const ReadNode& read, bool) {
    if (!read(Momentum::projected, point).ok()) return false;
    add_to_path(point, path);
    return !time_is_up();
  };
  (void)run_steps_of(motion_.scene, motion_.registry, motion_.solvers, steps_of(refinement), report_.adaptive,
                     motion_.end, work, at_node);
  report_.work.solves += work.solves;
  return path;
}

/// Looks for what the steps of the last run do not resolve, before it is accepted or because the runs do not
/// converge.  False where the motion is divided anew or the
/// search is refused.
bool RefinementSearch::survey(bool accepted) {
  surveyed_ = true;
  if (local_) return true;  // such steps are short where the forces change fast
  if (motion_.scene->space) return true;  // the paths between points are those of R^n
  // A coarse run with fixed steps shows the way; the last one after a division, for the place of a kink
  // depends on the motion, and with variable steps, which may be far longer than what they follow.
  const long way = divisions_ == 0 && !report_.adaptive ? coarsest_.refinement : refinement_;
  const std::vector<PathPoint> path = divisions_ == 0 ? path_ : path_of(way);
  if (path.size() < 2 || !reached_end(path.back().time))
    return refuse("the time was used up before the forces along the motion were surveyed (--max-time)");
  ForceSurvey forces(*motion_.scene, motion_.options.error);
  const long parts = std::max(1L, std::lround(static_cast<double>(refinement_) / static_cast<double>(way)));
  const ForceSurveyReport found = forces.along(path, parts);
  if (found.missed <= missed_allowed * motion_.options.error) return true;
  fast_ = "the force changes fast near t = " + to_text(found.time);
  if (!accepted && (!found.followed || report_.adaptive)) return true;  // finer steps may do
  if (!found.followed)
    refuse(fast_ + " and on much of the motion: steps that follow it would be too many");
  else if (report_.adaptive)
    refuse(fast_ + ", and variable steps cannot be divided there; use fixed ones (--fixed)");
  else if (++divisions_ > max_divisions)
    refuse(fast_ + "; dividing the motion there " + std::to_string(max_divisions) +
           " times did not resolve it to the error asked for");
  else
    divide(found);
  return false;
}

void RefinementSearch::divide(const ForceSurveyReport& found) {
  plan_ = StepPlan(found.stretches, first_);
  begin_anew(unit_ = 1);
  report_.division = fast_ + ": the steps are divided there, into " +
                     std::to_string(plan_.stretches().size()) + " stretches";
}

/// How much farther apart a run and one from beside its start end than they begin, relative to the sizes of
/// both; 0 where that is not known.
double RefinementSearch::amplification(const Counted& run) {
  auto moved = std::make_shared<Scene>(*motion_.scene);
  moved->start = beside(moved->start, largest_position_, largest_velocity_);
  Sample end;
  Work work;
  (void)run_steps_of(moved, motion_.registry, motion_.solvers, steps_of(run.refinement), report_.adaptive,
                     motion_.end, work, [&](const ReadNode& read, bool last) {
                       if (last && !read(Momentum::projected, end).ok()) end = {};
                       return !time_is_up();
                     });
  report_.work.solves += work.solves;
  if (end.q.size() == 0) return 0.0;
  double apart = relative_change(end.q, run.end.q, largest_position_);
  if (largest_momentum_ > 0.0) apart = std::max(apart, relative_change(end.p, run.end.p, largest_momentum_));
  return std::isfinite(apart) ? apart / distance_beside : 0.0;
}

/// The error that round-off alone leaves, as far as the motion amplifies it; the finest run is asked where a
/// coarse one tells of too much, if that one is accepted.
double RefinementSearch::amplified_round_off(bool accepted) {
  if (local_ || convergence_.runs() == 0) return 0.0;
  growth_ = amplification(coarsest_);
  const auto left = [this] {
    return growth_ > growth_of_no_power ? growth_ * round_off_of(last_steps_) : 0.0;
  };
  if (accepted && left() > motion_.options.error) growth_ = amplification(last_.back());
  return left();
}

/// Refuses, for the growth of errors where that explains it.
bool RefinementSearch::refuse_unless_amplified(const std::string& why) {
  const double left = amplified_round_off(false);
  return refuse(left > motion_.options.error ? amplified(left) : why);
}

std::string RefinementSearch::amplified(double left) const {
  return "the motion amplifies errors by a factor of " + text(growth_) +
         ", so that round-off alone leaves one of " + text(left);
}

/// Ends the search with the last run, where the motion does not amplify round-off above the error asked for.
bool RefinementSearch::accept() {
  const double left = amplified_round_off(true);
  if (left > motion_.options.error) return refuse(amplified(left));
  report_.estimate = std::max(report_.estimate, left);
  accepted_ = true;
  report_.warning = doubt_;
  // Orders of differences that are round-off say nothing.
  if (convergence_.difference() <= round_off_of(last_steps_)) report_.observed_order = std::nan("");
  return false;
}

/// Ends the search, for which false stands.
bool RefinementSearch::refuse(const std::string& why) {
  report_.refusal = "error " + text(motion_.options.error) + " not reached: " + why;
  if (!fast_.empty() && why.find(fast_) == std::string::npos) report_.refusal += "; " + fast_;
  if (convergence_.runs() > 1)
    report_.refusal += "; the best answer so far has an estimated error of " + text(report_.estimate) +
                       (convergence_.order_confirmed() ? "" : ", which the observed orders do not confirm");
  return false;
}

}  // namespace diracstep::detail
