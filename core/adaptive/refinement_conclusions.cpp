#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/refinement_search.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/frames.hpp>
#include <diracstep/core/runs/growth_check.hpp>
#include <diracstep/core/system/kinks.hpp>

/// What a RefinementSearch concludes from its runs: whether there is to be another one, whether forces that
/// change fast or round-off that grows speak against the last, and how the search ends.
namespace diracstep::detail {

namespace {

constexpr int max_divisions = 6;
constexpr std::size_t max_runs = 60;
constexpr std::size_t runs_to_converge = 8, runs_to_resolve_kinks = 24;  // before stagnation counts
constexpr double missed_allowed = 0.1;          // by the forces surveyed, in parts of the error asked for
constexpr double least_part_left = 0.01;        // of an end beside the motion, that the forces are held to
constexpr double error_out_of_reach = 1e-15;    // differences of runs hold nothing but round-off below it
constexpr double part_of_time = 0.01;           // of the motion, in which balanced forces would act
constexpr double growth_of_no_power = 1e6;      // of two runs apart: powers of the time lead to less
constexpr double deviations_of_times = 2.0;     // standard ones, of what their round-off leaves
constexpr double smallest_local_error = 2e-14;  // below it steps have one of round-off

std::string text(double value) { return to_text(value, 3); }

/// Explicit steps solve nothing.
long effort(const ErrorControlRun& run) { return std::max(run.solves, run.steps); }

}  // namespace

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

/// Whether the forces change at known times and within less than a step: the survey divides the motion there.
bool RefinementSearch::ramps_of_time() const {
  const double start = motion_.scene->start.time, step = std::abs(plan_.mean_step(refinement_));
  return std::ranges::any_of(
      motion_.scene->kinks->instants(std::min(start, motion_.end), std::max(start, motion_.end)),
      [&](const Kinks::Instant& instant) { return instant.width > 0.0 && instant.width < step; });
}

/// Begins anew with compensated sums where round-off shows without them.
bool RefinementSearch::compensate() {
  if (!motion_.may_compensate || report_.compensated_sums || !convergence_.near_round_off()) return false;
  report_.compensated_sums = true;
  begin_anew(std::max(unit_, refinement_ / 4));
  return true;
}

/// What follows from the runs so far: their last is accepted, a finer one is to come, or the search ends,
/// for which false stands.
bool RefinementSearch::conclude() {
  if (convergence_.accepted()) {
    if (!survey(true)) return report_.refusal.empty();
    return accept();
  }
  // Runs that do not follow the motion yet cross its kinks in other places; ramps of the time stay where they
  // are.
  if (convergence_.runs() >= 4 && !convergence_.order_confirmed() && !surveyed_ &&
      (!kinks_on_the_way() || ramps_of_time()) && !survey(false))
    return report_.refusal.empty();
  if (compensate()) return true;
  const std::size_t patience = kinks_on_the_way() ? runs_to_resolve_kinks : runs_to_converge;
  if (convergence_.stagnates() && (convergence_.runs() > patience || convergence_.difference() < 1e-4))
    return refuse_unless_amplified(convergence_.obstacle());
  const double next = static_cast<double>(refinement_) / convergence_.next_factor();
  refinement_ = std::max(refinement_ + 1, std::lround(next));
  return true;
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

void RefinementSearch::see_sizes(const Sample& node) {
  rest_.see(node);
  const double time = part_of_time * (motion_.end - motion_.scene->start.time), speed = rest_.speed(time);
  positions_.see(max_norm(node.q), std::abs(time) * speed);
  momenta_.see(max_norm(node.p), rest_.momentum(time));
  velocities_.see(max_norm(node.v), speed);
  const auto raise = [](Vector& sizes, const Vector& column) {
    if (sizes.size() != column.size()) sizes.setZero(column.size());
    sizes = sizes.cwiseMax(column.cwiseAbs());
  };
  raise(sizes_of_q_, node.q);
  raise(sizes_of_v_, node.v);
}

/// The size of the end in parts of the largest on the way, of q or p whichever is less: what the forces miss
/// along the motion is to be small beside the end.
double RefinementSearch::part_left_at_end() const {
  const auto part = [](const Vector& column, const WaySize& way) {
    return way.largest > 0.0 ? size_at_end(column, way) / way.largest : 1.0;
  };
  return std::clamp(std::min(part(report_.end.q, positions_), part(report_.end.p, momenta_)), least_part_left,
                    1.0);
}

/// Looks for what the steps of the last run do not resolve, before it is accepted or because the runs do not
/// converge.  False where the motion is divided anew or the
/// search is refused.
bool RefinementSearch::survey(bool accepted) {
  surveyed_ = true;
  if (local_) return true;                // such steps are short where the forces change fast
  if (motion_.scene->space) return true;  // the paths between points are those of R^n
  // A coarse run with fixed steps shows the way; the last one after a division, for the place of a kink
  // depends on the motion, and with variable steps, which may be far longer than what they follow.  Where the
  // motion crosses kinks a coarse run may take another way.
  const bool follows = divisions_ == 0 && !(accepted && kinks_on_the_way());
  const long way = report_.adaptive || divisions_ > 0 ? refinement_
                   : follows                          ? coarsest_.refinement
                                                      : last_.front().refinement;
  const std::vector<PathPoint> path = follows ? path_ : path_of(way);
  if (path.size() < 2 || !reached_end(path.back().time))
    return refuse("the time was used up before the forces along the motion were surveyed (--max-time)");
  const double allowed = motion_.options.error * part_left_at_end();
  ForceSurvey forces(*motion_.scene, allowed);
  const long parts = std::max(1L, std::lround(static_cast<double>(refinement_) / static_cast<double>(way)));
  const ForceSurveyReport found = forces.along(path, parts);
  rounding_of_times_ = found.rounding;
  if (found.missed <= missed_allowed * allowed) return true;
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

/// A run from beside the start: its first point and its end, which is empty where it does not get there or
/// where the rows allow no such start.
std::pair<Sample, Sample> RefinementSearch::run_beside(const Counted& run) {
  if (sizes_of_q_.size() == 0) return {};
  auto moved = std::make_shared<Scene>(*motion_.scene);
  moved->start = beside(moved->start, sizes_of_q_, sizes_of_v_);
  Sample first, end;
  Work work;
  const auto at_node = [&](const ReadNode& read, bool last) {
    if (first.q.size() == 0 && !read(Momentum::projected, first).ok()) return false;
    if (last && !read(Momentum::projected, end).ok()) end = {};
    return !time_is_up() && !(motion_.options.go_on && !motion_.options.go_on());
  };
  auto steps = steps_of(run.refinement);
  // A row of large units at rest, or of a state that follows within a microsecond, is off by more than a
  // start may be.
  for (const bool projected : {false, true}) try {
      steps.integrator.project_start = projected;
      (void)run_steps_of(moved, motion_.registry, motion_.solvers, steps, report_.adaptive, motion_.end, work,
                         at_node);
      break;
    } catch (const Misuse&) {  // a point that cannot be started from
      end = {};
    }
  report_.work.solves += work.solves;
  return {first, end};
}

/// How much farther apart a run and one from beside its start end than they begin, relative to the sizes of
/// both; 0 where that is not known.
double RefinementSearch::amplification(const Counted& run) {
  const auto [first, moved] = run_beside(run);
  if (moved.q.size() == 0) return 0.0;
  const Sample end = in_frames_of(run.end.q, moved, motion_.scene->space.get());
  double growth = relative_change(end.q, run.end.q, positions_) / distance_beside;
  if (const double size = std::max(momenta_.largest, momenta_.unbalanced); size > 0.0) {
    // The momenta of a heavy coordinate whose way is short are far apart from the first.
    const double begin = path_.empty() ? 0.0 : max_norm(first.p - path_.front().p) / size;
    growth = std::max(growth, relative_change(end.p, run.end.p, momenta_) / std::max(distance_beside, begin));
  }
  return std::isfinite(growth) ? growth : 0.0;
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
  double left = amplified_round_off(true);
  if (left > motion_.options.error) return refuse(amplified(left));
  const double of_times = deviations_of_times * rounding_of_times_ *
                          std::max(1.0 / part_left_at_end(), growth_);  // that is in parts of the end, too
  if (of_times > motion_.options.error)
    return refuse("the forces change so fast that the round-off of the time alone leaves an error of " +
                  text(of_times));
  const bool by_times = of_times > std::max(left, report_.estimate);
  left = std::max(left, of_times);
  report_.estimate = std::max(report_.estimate, left);
  accepted_ = true;
  report_.warning = doubt_;
  report_.grounds = by_times ? "that of the round-off of times, at which forces change fast"
                    : left > convergence_.estimate() ? "that of round-off, which the motion amplifies"
                                                     : convergence_.grounds();
  // Orders of differences that are round-off say nothing.
  if (convergence_.at_round_off()) report_.observed_order = std::nan("");
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
