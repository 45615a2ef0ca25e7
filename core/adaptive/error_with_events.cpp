#include <chrono>
#include <cmath>
#include <diracstep/core/adaptive/convergence.hpp>
#include <diracstep/core/adaptive/end_errors.hpp>
#include <diracstep/core/adaptive/error_with_events.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/event_steps.hpp>

namespace diracstep {

namespace {

constexpr int most_failures = 3;          // of runs in a row
constexpr long steps_between_looks = 64;  // at the clock

/// A motion through events that is repeated with smaller and smaller steps.
class EventRuns {
 public:
  EventRuns(std::function<std::unique_ptr<EventSteps<Integrator>>(double step)> make, double start,
            double end, const ErrorControlOptions& options)
      : make_(std::move(make)), start_(start), end_(end), options_(options) {}

  /// Where a run ends, what it met, and the largest of its columns on the way.
  struct Run {
    std::string failure;
    Sample end;
    std::vector<std::size_t> met;
    double q = 0.0, p = 0.0, v = 0.0;
    Work work;
  };

  Run run(double step) {
    Run run;
    const StepGrid grid = fit_steps(start_, end_, step);
    const auto motion = make_(grid.step);
    for (long k = 0; k < grid.steps && run.failure.empty() && !motion->stopped(); ++k) {
      if (const StepReport report = motion->step(); !report.ok())
        run.failure = report.failure.empty() ? describe(report.solve.status) : report.failure;
      run.q = std::max(run.q, max_norm(motion->stepper().position()));
      run.p = std::max(run.p, max_norm(motion->stepper().momentum()));
      run.v = std::max(run.v, max_norm(motion->stepper().velocity_estimate()));
      if (k % steps_between_looks == 0 && used_up(motion->work().solves)) run.failure = limit();
    }
    if (const SolveReport solve = motion->sample(run.end); !solve.ok() && run.failure.empty())
      run.failure = describe(solve.status);
    if (motion->stopped()) run.end = motion->end_of_stopped();
    for (const EventHit& hit : motion->hits()) run.met.push_back(hit.event);
    run.work = motion->work();
    solves_ += run.work.solves;
    return run;
  }

  double difference(const Run& a, const Run& b) const {
    if (a.met != b.met) return 1.0;
    return std::max({detail::relative_change(a.end.q, b.end.q, {b.q}),
                     detail::relative_change(a.end.p, b.end.p, {b.p}),
                     detail::relative_change(a.end.v, b.end.v, {b.v}),
                     std::abs(a.end.time - b.end.time) / std::abs(end_ - start_)});
  }

  bool used_up(long solves) const {
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - began_;
    return solves_ + solves > options_.max_solves || passed.count() > options_.max_time ||
           (options_.go_on && !options_.go_on());
  }
  std::string limit() const {
    if (options_.go_on && !options_.go_on()) return "interrupted";
    return "not finished with the time or work allowed (--max-time, --max-solves)";
  }
  long solves_left() const { return options_.max_solves - solves_; }

 private:
  std::function<std::unique_ptr<EventSteps<Integrator>>(double step)> make_;
  double start_, end_;
  const ErrorControlOptions& options_;
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
  long solves_ = 0;
};

}  // namespace

ErrorControlReport solve_events_to_error(const std::shared_ptr<const Scene>& start,
                                         const std::shared_ptr<const Scene>& all,
                                         const std::vector<Event>& events, const Registry& registry,
                                         const SolverFactory& solvers, double end,
                                         const ErrorControlOptions& options) {
  if (!(options.error > 0.0 && options.error < 1.0))
    throw Misuse("error = " + to_text(options.error) + "; a number above 0 and below 1 is needed");
  IntegratorOptions integrator = options.integrator;
  integrator.method = options.method;
  integrator.order = options.order;
  integrator.step = std::copysign(options.first_step, end - start->start.time);
  const auto make = [&](double step) {
    integrator.step = step;
    return std::make_unique<EventSteps<Integrator>>(start, all, events, solvers, Momentum::projected,
                                                    integrators(registry, solvers, integrator));
  };
  ErrorControlReport report;
  {
    const Integrator first(start, registry, solvers, integrator);
    report.method = first.options().method;
    report.order = first.options().order;
  }
  report.reason = "fixed steps: events act on the way";
  Convergence convergence(report.order, options.error);
  EventRuns runs(make, start->start.time, end, options);
  EventRuns::Run last;
  int failures = 0;
  for (double step = integrator.step; report.refusal.empty(); step *= 0.5) {
    EventRuns::Run run = runs.run(step);
    report.work.add(run.work);
    report.runs.push_back({.step = integrator.step,
                           .steps = run.work.steps,
                           .solves = run.work.solves,
                           .failure = run.failure});
    if (!run.failure.empty()) {
      if (runs.used_up(0) || ++failures == most_failures) report.refusal = run.failure;
      continue;
    }
    failures = 0;
    convergence.add(std::abs(integrator.step), convergence.runs() == 0 ? 0.0 : runs.difference(last, run),
                    detail::round_off_of(run.work.steps));
    last = std::move(run);
    report.step = integrator.step;
    report.end = last.end;
    report.observed_order = convergence.observed_order();
    if (convergence.runs() > 1)
      report.estimate = std::max(convergence.estimate(), detail::round_off_of(last.work.steps));
    report.runs.back().difference = convergence.difference();
    report.runs.back().estimate = report.estimate;
    report.runs.back().observed_order = report.observed_order;
    if (convergence.accepted()) {
      report.grounds = convergence.grounds();
      break;
    }
    if (convergence.stagnates())
      report.refusal = convergence.obstacle();
    else if (const double to_go = 2.0 * static_cast<double>(last.work.solves) * convergence.work_to_go();
             runs.used_up(0) || to_go > static_cast<double>(runs.solves_left()))
      report.refusal = runs.limit();
  }
  integrator.step = report.step;
  report.steps.integrator = integrator;
  if (!report.refusal.empty())
    report.refusal = "error " + to_text(options.error) + " not reached: " + report.refusal +
                     (std::isnan(report.estimate)
                          ? std::string()
                          : "; the best answer so far has an estimated error of " + to_text(report.estimate));
  return report;
}

}  // namespace diracstep
