#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/adaptive/rate_survey.hpp>
#include <diracstep/core/adaptive/refinement.hpp>
#include <diracstep/core/methods/default_method.hpp>
#include <diracstep/core/numerics/errors.hpp>

namespace diracstep {
namespace {

constexpr long survey_steps = 400;
constexpr std::size_t max_runs = 24;
constexpr int max_halvings = 12;  // while the coarse runs fail

std::string text(double value) { return to_text(value, 3); }

/// Repeats one motion with finer and finer steps.
class Search {
 public:
  Search(std::shared_ptr<const Scene> scene, const Registry& registry, const SolverFactory& solvers,
         double end, const ErrorControlOptions& options, ErrorControlReport& report)
      : scene_(std::move(scene)),
        registry_(registry),
        solvers_(solvers),
        end_(end),
        options_(options),
        report_(report),
        refinement_(options.error, report.order) {}

  void go(double first_step) {
    double h = first_step;
    for (int halvings = 0; !run(h); h *= 0.5)
      if (stopped(0.5 * h)) {
        return;
      } else if (++halvings > max_halvings) {
        return refuse("a run failed even with the step " + text(h) + ": " + report_.runs.back().failure);
      }
    h *= 0.5;
    while (report_.runs.size() < max_runs) {
      if (stopped(h)) return;
      if (!run(h)) {  // a coarse step may fail between two that do not
        h *= 0.5;
        continue;
      }
      if (refinement_.accepted()) return accept();
      if (refinement_.stagnates())
        return refuse("the runs no longer come closer to each other than " +
                      text(report_.runs.back().difference) +
                      ": round-off, or a motion that amplifies it, sets the limit");
      h *= refinement_.next_factor();
    }
    refuse("no convergence in " + std::to_string(max_runs) + " runs");
  }

 private:
  IntegratorOptions integrator_options(double step) const {
    return {.method = report_.method,
            .order = report_.order,
            .step = step,
            .compensated_sums = report_.compensated_sums};
  }

  /// One run to the end; false where it failed, which is told in the report.
  bool run(double h) {
    ErrorControlRun& now = report_.runs.emplace_back();
    now.step = h;
    Sample last;
    const auto keep = [&last](const Sample& sample) {
      last = sample;
      return true;
    };
    const double sign = end_ > scene_->start.time ? 1.0 : -1.0;
    if (report_.adaptive) {
      AdaptiveIntegrator integrator(scene_, registry_, solvers_, integrator_options(sign * h),
                                    {.eps = h, .monitor = options_.monitor, .scales = scales, .end = end_});
      const RunReport done = run_until(integrator, end_, Momentum::projected, max_steps, keep);
      note(now, done, integrator.work(), integrator.side_work());
      if (integrator.control().resets * 1000 > integrator.work().steps)
        report_.warning = "the step controller was reset " + std::to_string(integrator.control().resets) +
                          " times in " + std::to_string(integrator.work().steps) + " steps";
      else
        report_.warning.clear();
    } else {
      const StepGrid grid = fit_steps(scene_->start.time, end_, sign * h);
      Integrator integrator(scene_, registry_, solvers_, integrator_options(grid.step));
      now.step = std::abs(grid.step);
      const RunReport done = run_steps(integrator, grid.steps, Momentum::projected, grid.steps, keep);
      note(now, done, integrator.work(), {});
    }
    if (now.failure.empty() && !(last.q.allFinite() && last.p.allFinite()))
      now.failure = "the end is not finite";
    if (!now.failure.empty()) return false;
    if (report_.end.q.size() > 0) now.difference = relative_change(last, report_.end);
    refinement_.add(now);
    report_.end = last;
    report_.estimate = now.estimate;
    report_.observed_order = now.observed_order;
    report_.step = sign * now.step;
    return true;
  }

  void note(ErrorControlRun& now, const RunReport& done, const Work& work, const Work& side) {
    now.steps = work.steps;
    now.solves = work.solves + side.solves;
    now.failure = done.last.failure;
    for (const Work* part : {&work, &side}) add(*part);
  }

  void add(const Work& part) {
    Work& all = report_.work;
    all.steps += part.steps;
    all.solves += part.solves;
    all.iterations += part.iterations;
    all.residual_evaluations += part.residual_evaluations;
    all.jacobian_evaluations += part.jacobian_evaluations;
  }

  void accept() {
    const ErrorControlRun& now = report_.runs.back();
    if (now.observed_order < report_.order - 1.0 && now.difference > 1e-12)
      report_.warning = "the observed order is " + text(now.observed_order) + ", the stated one " +
                        std::to_string(report_.order) + "; the estimate assumes the lower one";
  }

  void refuse(const std::string& why) {
    report_.refusal = "error " + text(options_.error) + " not reached: " + why;
  }

  /// Explicit steps solve nothing.
  static double work(long solves, long steps) { return static_cast<double>(std::max(solves, steps)); }

  /// Whether there will be no run with the step h, which is then told.
  bool stopped(double h) {
    const ErrorControlRun& last = report_.runs.back();
    const double expected =
        work(report_.work.solves, report_.work.steps) + work(last.solves, last.steps) * last.step / h;
    if (options_.go_on && !options_.go_on())
      refuse("interrupted");
    else if (expected > static_cast<double>(options_.max_solves))
      refuse("the next run would bring the work to " + text(expected) +
             " nonlinear systems or explicit steps; the estimate is " + text(last.estimate) + " so far");
    else
      return false;
    return true;
  }

  static constexpr long max_steps = std::numeric_limits<long>::max();

  std::shared_ptr<const Scene> scene_;
  const Registry& registry_;
  const SolverFactory& solvers_;
  double end_;
  const ErrorControlOptions& options_;
  ErrorControlReport& report_;
  Refinement refinement_;

 public:
  MonitorScales scales;
};

/// Whether variable steps pay, with the reason.
bool choose_adaptive(const ErrorControlOptions& options, const RateSurvey& survey, std::string& reason) {
  if (options.adaptive) {
    reason = "as asked for";
    return *options.adaptive;
  }
  if (options.monitor.rate) {
    reason = "a monitor is given";
    return survey.failure.empty();
  }
  reason = "max ω / min ω = " + text(survey.ratio());
  return survey.failure.empty() && survey.variable_steps_pay();
}

/// The method and its order, and whether sums are compensated: for small errors, where the library chooses.
void choose_method(const Scene& scene, const Registry& registry, const ErrorControlOptions& options,
                   ErrorControlReport& report) {
  if (options.method != automatic_method) {
    const MethodInfo info = registry.method(options.method).info;
    report.method = info.name;
    report.order = options.order == 0 ? info.order : options.order;
    report.compensated_sums = options.compensated_sums.value_or(false);
    return;
  }
  const DefaultMethod choice = default_method(scene, {.order = options.order, .error = options.error});
  const bool has_compensated_sums = registry.method(choice.method).info.stages > 0;
  report.method = choice.method;
  report.order = choice.order;
  report.method_reason = choice.reason;
  report.compensated_sums = options.compensated_sums.value_or(
      has_compensated_sums && has_accelerations(scene) && options.error < 1e-8);
}

/// Radians of a step of varying size, or the size of a fixed one, to begin with: coarse, since the runs that
/// follow are finer by 2 and more.
double first_step(const Scene& scene, const ErrorControlOptions& options, const ErrorControlReport& report,
                  const RateSurvey& survey, double end) {
  const double accuracy = std::pow(options.error, 1.0 / report.order);
  if (report.adaptive) return std::clamp(5.0 * accuracy, 0.02, 1.2);
  if (options.first_step > 0.0) return options.first_step;
  const double step = std::abs(end - scene.start.time) / 20.0;
  if (!(survey.fastest > 0.0)) return step;
  return std::min(step, std::clamp(12.0 * accuracy, 0.05, 4.0) / survey.fastest);
}

}  // namespace

ErrorControlReport solve_to_error(const std::shared_ptr<const Scene>& given, const Registry& registry,
                                  const SolverFactory& solvers, double end,
                                  const ErrorControlOptions& options) {
  if (!(options.error > 0.0) || !(options.error < 1.0))
    throw Misuse("error = " + text(options.error) + "; a relative error between 0 and 1 is needed");
  const auto scene = completed(given);
  ErrorControlReport report;
  choose_method(*scene, registry, options, report);
  RateSurvey survey;
  if (has_accelerations(*scene)) {
    survey = survey_rate(*scene, solvers, end, survey_steps);
    report.adaptive = choose_adaptive(options, survey, report.reason);
  }
  const auto search = [&] {
    Search repeated(scene, registry, solvers, end, options, report);
    repeated.scales = survey.scales;
    repeated.go(first_step(*scene, options, report, survey, end));
  };
  search();
  if (!report.adaptive || report.ok() || options.adaptive) return report;
  report.reason = "variable steps did not get there: " + report.refusal;
  report.refusal.clear();
  report.warning.clear();
  report.end = {};
  report.adaptive = false;
  search();
  return report;
}

}  // namespace diracstep
