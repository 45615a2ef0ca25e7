#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <diracstep/core/integrator/prepared_scene.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/validation/references/ida_reference.hpp>
#include <diracstep/validation/studies/stability_study.hpp>
#include <diracstep/validation/studies/study_run.hpp>
#include <diracstep/validation/studies/work_precision.hpp>

namespace diracstep {

namespace {

constexpr long points_read = 400;
constexpr int blocks = 20;
constexpr double student_t = 2.101;  // 97.5 % quantile of Student's t with 18 degrees of freedom
constexpr long ida_max_steps = 200'000;
constexpr double ida_least_budget = 0.05;  // CPU seconds

struct Point {
  double time, deviation;
};

/// Least squares through the means of `blocks` equal parts; means of long blocks are close to independent
/// where the deviation oscillates faster than a block is long.
void fit_drift(const std::vector<Point>& points, WatchResult& result) {
  if (points.size() < 2 * blocks) return;
  std::array<Point, blocks> means{};
  double time = 0.0, deviation = 0.0;
  for (std::size_t b = 0; b < blocks; ++b) {
    const std::size_t first = b * points.size() / blocks, last = (b + 1) * points.size() / blocks;
    for (std::size_t i = first; i < last; ++i) {
      means[b].time += points[i].time / static_cast<double>(last - first);
      means[b].deviation += points[i].deviation / static_cast<double>(last - first);
    }
    time += means[b].time / blocks;
    deviation += means[b].deviation / blocks;
  }
  double spread = 0.0, covariance = 0.0, rest = 0.0;
  for (const Point& mean : means) {
    spread += (mean.time - time) * (mean.time - time);
    covariance += (mean.time - time) * (mean.deviation - deviation);
  }
  result.drift = covariance / spread;
  for (const Point& mean : means) {
    const double miss = mean.deviation - deviation - result.drift * (mean.time - time);
    rest += miss * miss;
  }
  result.drift_half_width = student_t * std::sqrt(rest / (blocks - 2) / spread);
}

/// Follows one watch along a run.
class Watching {
 public:
  Watching(const WatchedQuantity& watch, const Start& start)
      : watch_(watch), start_value_(watch.at(start.time, start.q, start.v)) {
    result_.name = watch.name;
  }

  double deviation(const Sample& sample) const {
    const double change = (watch_.at(sample.time, sample.q, sample.v) - start_value_) / watch_.scale;
    return watch_.only_up ? std::max(change, 0.0) : change;
  }

  void see(const Sample& sample) {
    const double now = deviation(sample);
    points_.push_back({sample.time, now});
    if (points_.size() == 1) result_.band = 0.0;
    if (std::isnan(now) || std::abs(now) > result_.band) result_.band = std::abs(now);
    within_ = within_ && std::abs(now) <= watch_.bound;
    if (within_) result_.bounded_until = sample.time;
  }

  bool within() const { return within_ && !points_.empty(); }

  WatchResult conclude() {
    fit_drift(points_, result_);
    return result_;
  }

 private:
  const WatchedQuantity& watch_;
  double start_value_;
  std::vector<Point> points_;
  bool within_ = true;
  WatchResult result_;
};

/// Ends a run of IDA from within.
struct CaseEnded {};

/// The reference at the end, where the case has one; IDA is asked only where nothing else can be watched.
ReferenceEnd reference_of(const StabilityCase& that, const std::function<void()>& look) {
  if (that.watches.empty() || (that.scene.reference.at && that.scene.reference.at(that.t_end)))
    return reference_end(that.scene, that.t_end, look);
  return {.kind = {}, .how = {}, .missing = "no reference", .q = {}, .p = {}};
}

/// Error and violation of the rows at a point, by the same measure as in a convergence study.
StudyRow judged(const Scene& scene, const Sample& sample, const ReferenceEnd& reference) {
  StudyRow row;
  judge(row, scene, sample, reference);
  return row;
}

class CaseRun {
 public:
  CaseRun(const StabilityCase& that, Integrator& integrator, StabilityRow& row,
          const std::function<bool()>& going_on)
      : case_(that),
        integrator_(integrator),
        row_(row),
        going_on_(going_on),
        reference_(reference_of(that, [&] {
          if (going_on && !going_on()) throw CaseEnded{};
        })) {
    for (const WatchedQuantity& watch : that.watches) watching_.emplace_back(watch, integrator.scene().start);
  }

  void run(long steps) {
    const double before = thread_seconds();
    RunChecks checks(integrator_, steps);
    const RunReport report = run_steps(
        integrator_, steps, Momentum::projected, std::max(1L, steps / points_read),
        [this](const Sample& sample) { return see(sample); }, &checks);
    const StepReport& last = report.last;
    doubt_ = checks.text();
    row_.cpu_seconds = thread_seconds() - before;
    row_.steps = integrator_.work().steps;
    row_.newton_iterations = integrator_.work().iterations;
    row_.t_reached = integrator_.time();
    for (Watching& watching : watching_) row_.watches.push_back(watching.conclude());
    if (!last.ok()) row_.failed_solves = 1;
    row_.message = last.failure;
    row_.outcome = outcome(last.ok());
  }

 private:
  static constexpr double unwatched_bound = 0.5;  ///< of the error, where there is no watch

  /// One of some 400 points on the way.
  bool see(const Sample& sample) {
    end_ = sample;
    for (Watching& watching : watching_) watching.see(sample);
    const StudyRow here = judged(integrator_.scene(), sample, nothing_);
    row_.constraint =
        std::isnan(row_.constraint) ? here.constraint : std::max(row_.constraint, here.constraint);
    return !going_on_ || going_on_();
  }

  StabilityOutcome outcome(bool finished) {
    if (!finished) return StabilityOutcome::stopped;
    if (reference_.missing.empty()) row_.error = judged(integrator_.scene(), end_, reference_).error();
    if (row_.error <= case_.accuracy) return StabilityOutcome::accurate;
    const bool bounded = watching_.empty()
                             ? row_.error <= unwatched_bound
                             : std::ranges::all_of(watching_, [](const Watching& w) { return w.within(); });
    if (bounded) return StabilityOutcome::bounded;
    row_.message = doubt_;
    return row_.message.empty() ? StabilityOutcome::wrong : StabilityOutcome::doubted;
  }

  const StabilityCase& case_;
  Integrator& integrator_;
  StabilityRow& row_;
  const std::function<bool()>& going_on_;
  ReferenceEnd reference_;
  ReferenceEnd nothing_{.kind = {}, .how = {}, .missing = "not asked", .q = {}, .p = {}};
  std::string doubt_;  ///< of a finished run
  std::vector<Watching> watching_;
  Sample end_;
};

IdaBeside run_ida_beside(const StabilityCase& that, const ReferenceEnd& reference, double rtol,
                         const std::function<void()>& look) {
  IdaBeside beside{.rtol = rtol};
  try {
    const auto given = completed(that.scene.scene);
    const auto without = given->refuse_redundant_rows ? given : with_independent_rows(given);
    const Scene& scene = *without;
    const ReferenceRun run =
        integrate_with_ida(scene, that.t_end, {.rtol = rtol, .max_steps = ida_max_steps, .look = look});
    beside.cpu_seconds = run.cpu_seconds;
    if (!run.ok()) {
      beside.status = run.failure;
      return beside;
    }
    const StudyRow end = judged(scene, run.end, reference);
    beside.constraint = end.constraint;
    if (reference.missing.empty()) beside.error = end.error();
    beside.deviation = 0.0;
    for (const WatchedQuantity& watch : that.watches)
      beside.deviation =
          std::max(beside.deviation, std::abs(Watching(watch, scene.start).deviation(run.end)));
  } catch (const Misuse& misuse) {
    beside.status = misuse.what();
  }
  return beside;
}

std::vector<IdaBeside> ida_ladder(const StabilityCase& that, double most_seconds,
                                  const std::function<void()>& look) {
  const ReferenceEnd reference = reference_of(that, look);
  std::vector<IdaBeside> runs;
  for (int decade = 3; decade <= 12; ++decade) {
    runs.push_back(run_ida_beside(that, reference, std::pow(10.0, -decade), look));
    if (!(runs.back().cpu_seconds <= std::max(most_seconds, ida_least_budget))) break;
  }
  return runs;
}

/// The tightest tolerance that succeeded at no more than `cpu_seconds`, else the cheapest success, else the
/// first failure.
std::optional<IdaBeside> at_cost(const std::vector<IdaBeside>& runs, double cpu_seconds) {
  std::optional<IdaBeside> found;
  for (const IdaBeside& run : runs) {
    if (!run.ok()) continue;
    if (!found || run.cpu_seconds <= cpu_seconds ||
        (found->cpu_seconds > cpu_seconds && run.cpu_seconds < found->cpu_seconds))
      found = run;
  }
  if (!found && !runs.empty()) found = runs.front();
  return found;
}

StabilityResult run_case(const StabilityCase& that, const Registry& registry, const SolverFactory& solvers,
                         const std::vector<StabilityMethod>& methods, bool with_ida,
                         const std::function<bool(const std::string&)>& look) {
  StabilityResult result{that, {}, {}};
  double most_seconds = 0.0;
  for (const StabilityMethod& method : methods) {
    const auto going_on = [&] { return look(that.name + ": " + method.name); };
    if (!going_on()) return result;
    StabilityRow row = run_stability_case(that, registry, solvers, method, going_on);
    if (!going_on()) return result;
    result.rows.push_back(std::move(row));
    if (result.rows.back().cpu_seconds > most_seconds) most_seconds = result.rows.back().cpu_seconds;
  }
  if (!with_ida) return result;
  try {
    result.ida = ida_ladder(that, most_seconds, [&] {
      if (!look(that.name + ": IDA")) throw CaseEnded{};
    });
  } catch (const CaseEnded&) {
    return result;
  }
  for (StabilityRow& row : result.rows)
    if (std::isfinite(row.cpu_seconds)) row.ida = at_cost(result.ida, row.cpu_seconds);
  return result;
}

}  // namespace

const char* name(StabilityOutcome outcome) {
  switch (outcome) {
    case StabilityOutcome::accurate:
      return "accurate";
    case StabilityOutcome::bounded:
      return "bounded";
    case StabilityOutcome::doubted:
      return "doubted";
    case StabilityOutcome::stopped:
      return "stopped";
    case StabilityOutcome::refused:
      return "refused";
    case StabilityOutcome::wrong:
      return "wrong";
  }
  return "unknown";
}

StabilityRow run_stability_case(const StabilityCase& that, const Registry& registry,
                                const SolverFactory& solvers, const StabilityMethod& method,
                                const std::function<bool()>& going_on) {
  StabilityRow row{.method = method.name, .order = method.order};
  try {
    const StepGrid grid = fit_steps(that.scene.scene->start.time, that.t_end, that.step);
    Integrator integrator(that.scene.scene, registry, solvers,
                          {.method = method.name, .order = method.order, .step = grid.step});
    row.order = integrator.options().order;
    CaseRun(that, integrator, row, going_on).run(grid.steps);
  } catch (const CaseEnded&) {
    row.message = "interrupted";
  } catch (const Misuse& misuse) {
    row.message = misuse.what();
  }
  return row;
}

std::vector<StabilityResult> stability_study(const std::vector<StabilityCase>& cases,
                                             const Registry& registry, const SolverFactory& solvers,
                                             const std::vector<StabilityMethod>& methods, bool with_ida,
                                             const StabilityObserver& observer) {
  std::vector<StabilityResult> results;
  bool going_on = true;
  for (const StabilityCase& that : cases) {
    const double part = static_cast<double>(results.size()) / static_cast<double>(cases.size());
    results.push_back(run_case(that, registry, solvers, methods, with_ida, [&](const std::string& what) {
      going_on = !observer || observer(part, what);
      return going_on;
    }));
    if (!going_on) break;
  }
  return results;
}

}  // namespace diracstep
