#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <sstream>

namespace diracstep {
namespace {

constexpr double safety = 2.5;  // between the estimate and the error asked for
constexpr double aimed = 0.2;   // part of the error asked for that the next run aims at
constexpr double pays = 5.0;    // max ω / min ω from which variable steps are taken
constexpr long survey_steps = 400;
constexpr std::size_t max_runs = 24;
constexpr int max_halvings = 12;  // while the coarse runs fail

double relative_change(const Vector& a, const Vector& b) {
  const double size = b.lpNorm<Eigen::Infinity>(), change = (a - b).lpNorm<Eigen::Infinity>();
  return size > 1e-14 ? change / size : change;
}

double relative_change(const Sample& a, const Sample& b) {
  return std::max(relative_change(a.q, b.q), relative_change(a.p, b.p));
}

/// p with  d1/d2 = (h0^p − h1^p)/(h1^p − h2^p);  the right side rises with p.
double observed_order(const std::array<double, 3>& h, double d1, double d2) {
  if (!(d1 > 0.0) || !(d2 > 0.0)) return std::nan("");
  double low = 0.01, high = 40.0;
  for (int k = 0; k < 60; ++k) {
    const double p = 0.5 * (low + high);
    const double a = std::pow(h[0] / h[1], p), b = std::pow(h[2] / h[1], p);
    ((a - 1.0) / (1.0 - b) < d1 / d2 ? low : high) = p;
  }
  return 0.5 * (low + high);
}

std::string text(double value) {
  std::ostringstream stream;
  stream.precision(3);
  stream << value;
  return stream.str();
}

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
        report_(report) {}

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
      judge();
      if (accepted()) return accept();
      if (stagnates())
        return refuse("the runs no longer come closer to each other than " +
                      text(report_.runs.back().difference) +
                      ": round-off, or a motion that amplifies it, sets the limit");
      h *= next_factor();
    }
    refuse("no convergence in " + std::to_string(max_runs) + " runs");
  }

 private:
  IntegratorOptions integrator_options(double step) const {
    return {.method = report_.method,
            .order = options_.order,
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
      const RunReport done = diracstep::run(integrator, end_, Momentum::projected, max_steps, keep);
      note(now, done, integrator.work(), integrator.side_work(), integrator.options().order);
      if (integrator.control().resets * 1000 > integrator.work().steps)
        report_.warning = "the step controller was reset " + std::to_string(integrator.control().resets) +
                          " times in " + std::to_string(integrator.work().steps) + " steps";
      else
        report_.warning.clear();
    } else {
      const StepGrid grid = fit_steps(scene_->start.time, end_, sign * h);
      Integrator integrator(scene_, registry_, solvers_, integrator_options(grid.step));
      now.step = std::abs(grid.step);
      const RunReport done = diracstep::run(integrator, grid.steps, Momentum::projected, grid.steps, keep);
      note(now, done, integrator.work(), {}, integrator.options().order);
    }
    if (now.failure.empty() && !(last.q.allFinite() && last.p.allFinite()))
      now.failure = "the end is not finite";
    if (!now.failure.empty()) return false;
    if (good_.size() == 3) good_.erase(good_.begin());
    good_.push_back(report_.runs.size() - 1);
    if (report_.end.q.size() > 0) now.difference = relative_change(last, report_.end);
    report_.end = last;
    report_.step = sign * now.step;
    return true;
  }

  void note(ErrorControlRun& now, const RunReport& done, const Work& work, const Work& side, int order) {
    now.steps = work.steps;
    now.solves = work.solves + side.solves;
    now.failure = done.last.failure;
    report_.order = order;
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

  /// Estimate and observed order of the last run.
  void judge() {
    ErrorControlRun& now = report_.runs[good_.back()];
    const ErrorControlRun& before = report_.runs[good_[good_.size() - 2]];
    now.estimate = now.difference / (std::pow(before.step / now.step, report_.order) - 1.0);
    if (good_.size() < 3) return;
    const ErrorControlRun& first = report_.runs[good_.front()];
    now.observed_order =
        observed_order({first.step, before.step, now.step}, before.difference, now.difference);
    // An order that falls short of the stated one makes the stated one too hopeful.
    const double usable = std::clamp(now.observed_order, 1.0, static_cast<double>(report_.order));
    if (usable < report_.order - 1.0)
      now.estimate = now.difference / (std::pow(before.step / now.step, usable) - 1.0);
  }

  bool order_confirmed() const {
    return std::abs(report_.runs[good_.back()].observed_order - report_.order) <= 1.0;
  }

  bool accepted() const {
    if (good_.size() < 3) return false;
    const ErrorControlRun& now = report_.runs[good_.back()];
    const ErrorControlRun& before = report_.runs[good_[good_.size() - 2]];
    if (order_confirmed()) return safety * now.estimate <= options_.error;
    // A higher order than the stated one shows steps that are still coarse: there the difference itself has
    // to do. A lower one comes with round-off.
    const bool high = now.observed_order > report_.order;
    const double before_allowed = high ? HUGE_VAL : options_.error / safety;
    return before.difference <= before_allowed && safety * now.difference <= options_.error;
  }

  void accept() {
    const ErrorControlRun& now = report_.runs[good_.back()];
    report_.estimate = now.estimate;
    report_.observed_order = now.observed_order;
    if (now.observed_order < report_.order - 1.0 && now.difference > 1e-12)
      report_.warning = "the observed order is " + text(now.observed_order) + ", the stated one " +
                        std::to_string(report_.order) + "; the estimate assumes the lower one";
  }

  void refuse(const std::string& why) {
    report_.refusal = "error " + text(options_.error) + " not reached: " + why;
    if (!good_.empty()) {
      report_.estimate = report_.runs[good_.back()].estimate;
      report_.observed_order = report_.runs[good_.back()].observed_order;
    }
  }

  /// Whether there will be no run with the step h, which is then told.
  bool stopped(double h) {
    const ErrorControlRun& last = report_.runs.back();
    const double expected =
        static_cast<double>(report_.work.solves) + static_cast<double>(last.solves) * last.step / h;
    if (options_.go_on && !options_.go_on())
      refuse("interrupted");
    else if (expected > static_cast<double>(options_.max_solves))
      refuse("the next run would bring the work to " + text(expected) +
             " nonlinear systems; the estimate is " + text(last.estimate) + " so far");
    else
      return false;
    return true;
  }

  /// Three refinements in a row that did not bring the runs closer, coarse runs of any motion aside.
  bool stagnates() {
    const ErrorControlRun& now = report_.runs[good_.back()];
    const ErrorControlRun& before = report_.runs[good_[good_.size() - 2]];
    const bool fell = !(now.difference > 0.5 * before.difference) || now.difference > 1e-4;
    stagnant_ = fell ? 0 : stagnant_ + 1;
    return stagnant_ >= 3;
  }

  double next_factor() const {
    const double estimate = report_.runs[good_.back()].estimate;
    if (!(estimate > 0.0) || stagnant_ > 0) return 0.7;
    return std::clamp(std::pow(aimed * options_.error / estimate, 1.0 / report_.order), 0.35, 0.7);
  }

  static constexpr long max_steps = std::numeric_limits<long>::max();

  std::shared_ptr<const Scene> scene_;
  const Registry& registry_;
  const SolverFactory& solvers_;
  double end_;
  const ErrorControlOptions& options_;
  ErrorControlReport& report_;
  std::vector<std::size_t> good_;  ///< numbers of the last runs that got to the end, at most three
  int stagnant_ = 0;

 public:
  MonitorScales scales;
};

/// Whether variable steps pay, with the reason.
bool choose_adaptive(const ErrorControlOptions& options, const RateSurvey& survey, std::string& reason) {
  if (options.adaptive) {
    reason = "as asked for";
    return *options.adaptive;
  }
  const double ratio = options.monitor.rate ? pays + 1.0 : survey.ratio();
  reason = options.monitor.rate ? "a monitor is given" : "max ω / min ω = " + text(ratio);
  return survey.failure.empty() && ratio > pays;
}

}  // namespace

std::string method_for(const Scene& scene, double error) {
  const int size = scene.dimension() + scene.rows();
  int stages = 2;
  if (size <= 12)
    stages = error > 1e-5 ? 3 : error > 1e-9 ? 4 : 6;
  else if (size <= 30)
    stages = error > 1e-8 ? 3 : 4;
  else
    stages = error > 1e-7 ? 2 : 3;
  return "type1/gl:" + std::to_string(stages);
}

ErrorControlReport solve_to_error(const std::shared_ptr<const Scene>& given, const Registry& registry,
                                  const SolverFactory& solvers, double end,
                                  const ErrorControlOptions& options) {
  if (!(options.error > 0.0) || !(options.error < 1.0))
    throw Misuse("error = " + text(options.error) + "; a relative error between 0 and 1 is needed");
  const auto scene = completed(given);
  const bool accelerates = !scene->lagrangian->structure().y_hessian_zero;
  ErrorControlReport report;
  report.method = options.method.empty() ? method_for(*scene, options.error) : options.method;
  const Method method = registry.method(report.method);
  const int order = options.order == 0 ? method.info.order : options.order;
  RateSurvey survey;
  if (accelerates) survey = survey_rate(*scene, solvers, end, survey_steps);
  if (accelerates) report.adaptive = choose_adaptive(options, survey, report.reason);
  report.compensated_sums =
      options.compensated_sums.value_or(options.method.empty() && accelerates && options.error < 1e-8);
  // Radians of the first step: coarse, since the runs that follow are finer by 2 and more.
  const double accuracy = std::pow(options.error, 1.0 / order);
  const double eps = std::clamp(5.0 * accuracy, 0.02, 1.2);
  const double span = std::abs(end - scene->start.time);
  double step = options.first_step > 0.0 ? options.first_step : span / 20.0;
  if (options.first_step <= 0.0 && survey.fastest > 0.0)
    step = std::min(step, std::clamp(12.0 * accuracy, 0.05, 4.0) / survey.fastest);

  const auto search = [&](double first) {
    Search repeated(scene, registry, solvers, end, options, report);
    repeated.scales = survey.scales;
    repeated.go(first);
  };
  if (report.adaptive) {
    search(eps);
    if (report.ok() || options.adaptive) return report;
    const ErrorControlReport tried = report;
    report.refusal.clear();
    report.warning.clear();
    report.end = {};
    report.adaptive = false;
    report.reason = "variable steps did not get there: " + tried.refusal;
  }
  search(step);
  return report;
}

}  // namespace diracstep
