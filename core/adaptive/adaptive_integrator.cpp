#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/adaptive/pointwise_motion.hpp>
#include <diracstep/core/adaptive/rate_survey.hpp>
#include <diracstep/core/methods/composition.hpp>
#include <diracstep/core/methods/default_method.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <utility>

namespace diracstep {

namespace {

constexpr double longest_of_such = 5.0;  // steps of the options: see may_change_later()
constexpr long scale_survey_steps = 120;

constexpr std::array<std::pair<const char*, StepControl>, 4> controls{
    {{"integrating", StepControl::integrating},
     {"in-step", StepControl::in_step},
     {"irreversible", StepControl::irreversible},
     {"local-error", StepControl::local_error}}};

/// The options of the integrator under the control: a step that solves for its size is no composition itself.
IntegratorOptions inner_options(IntegratorOptions options, const Registry& registry, StepControl control) {
  const MethodInfo info = registry.method(options.method).info;
  const bool composed = options.order != 0 && options.order != info.order;
  if (info.damped != (control == StepControl::local_error))
    throw Misuse(info.damped ? "method '" + info.name + "' varies its steps by their local error only"
                             : "steps by their local error are for damped/radau:S; those of '" + info.name +
                                   "' would lose what it keeps over long times");
  if (info.damped) return options;
  if (!info.self_adjoint && !composed)
    throw Misuse(
        "method '" + info.name +
        "' is not self-adjoint, so variable steps would not be reversible; compose it (order 2 or more) "
        "or use a fixed step");
  if (control == StepControl::in_step && composed) options.order = info.self_adjoint ? 0 : 2;
  return options;
}

/// "auto" replaced by the method it stands for.
IntegratorOptions with_method(IntegratorOptions options, const Scene& scene) {
  if (options.method != automatic_method) return options;
  const DefaultMethod choice =
      default_method(scene, {options.order, 0.0, options.constraint_rule, large_from(options.dense_limit)});
  options.method = choice.method;
  options.order = choice.order;
  return options;
}

std::vector<double> eps_fractions(const IntegratorOptions& given, int inner_order, StepControl control) {
  if (control != StepControl::in_step || given.order == 0 || given.order == inner_order) return {1.0};
  const auto fractions = composition_fractions(given.order);
  return {fractions.begin(), fractions.end()};
}

/// With what the defaults stand for.
AdaptiveOptions checked(AdaptiveOptions adaptive, const MethodInfo& method) {
  if (!std::isnan(adaptive.eps) && !(adaptive.eps > 0.0 && std::isfinite(adaptive.eps)))
    throw Misuse("eps = " + to_text(adaptive.eps) +
                 "; radians of a step, or its local error, above 0 are needed");
  if (method.damped && adaptive.control == StepControl::integrating)
    adaptive.control = StepControl::local_error;
  if (std::isnan(adaptive.eps))
    adaptive.eps = method.damped ? AdaptiveOptions::usual_local_error : AdaptiveOptions::usual_radians;
  return adaptive;
}

RateMeter make_meter(const Scene& scene, const SolverFactory& solvers, const AdaptiveOptions& adaptive,
                     double step, long& accelerations) {
  require_even(adaptive.monitor, scene.start);
  MonitorScales scales = adaptive.scales;
  const double end = adaptive.end.value_or(scene.start.time + 100.0 * step);
  if (!adaptive.monitor.rate && (scales.typical <= 0.0 || scales.lowest <= 0.0)) {
    const RateSurvey survey = survey_rate(scene, solvers, end, scale_survey_steps);
    if (scales.typical <= 0.0) scales.typical = survey.scales.typical;
    if (scales.lowest <= 0.0) scales.lowest = survey.scales.lowest;
    accelerations = survey.accelerations;
  }
  return {scene, solvers, adaptive.monitor, scales, end};
}

}  // namespace

const char* name(StepControl control) {
  for (const auto& [name, value] : controls)
    if (control == value) return name;
  return "";
}

StepControl step_control(const std::string& name) {
  for (const auto& [known, control] : controls)
    if (name == known) return control;
  throw Misuse("control: '" + name + "' is not one of integrating, in-step, irreversible, local-error");
}

AdaptiveIntegrator::AdaptiveIntegrator(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                                       const SolverFactory& solvers, IntegratorOptions options,
                                       const AdaptiveOptions& adaptive)
    : options_(with_method(std::move(options), *completed(scene))),
      adaptive_(checked(adaptive, registry.method(options_.method).info)),
      main_(scene, registry, solvers, inner_options(options_, registry, adaptive_.control)),
      side_(std::make_shared<const Scene>(main_.scene()), registry, solvers, options_),
      sign_(options_.step > 0.0 ? 1.0 : -1.0) {
  if (adaptive_.control == StepControl::local_error) {
    whole_.emplace(std::make_shared<const Scene>(main_.scene()), registry, solvers, options_);
    whole_->end_steps_at_kinks();
    local_.emplace(adaptive_.eps, main_.options().order, span(), adaptive_.smallest_step);
    if (adaptive_.end) instants_ = instants_on_the_way(main_.scene(), *adaptive_.end);
    if (adaptive_.end && may_change_later(main_.scene(), *adaptive_.end))
      longest_ = longest_of_such * std::abs(options_.step);
    if (adaptive_.largest_step > 0.0) longest_ = std::min(longest_, adaptive_.largest_step);
  } else {
    meter_.emplace(make_meter(main_.scene(), solvers, adaptive_, options_.step, report_.accelerations));
  }
  if (adaptive_.control != StepControl::in_step) main_.end_steps_at_kinks();
  side_.end_steps_at_kinks();
  fractions_ = eps_fractions(options_, main_.options().order, adaptive_.control);
  options_.order = side_.options().order;
  reset();
}

void AdaptiveIntegrator::reset() {
  const long survey = report_.accelerations;
  main_.reset();
  side_.reset();
  v_ = main_.scene().start.v;
  report_ = {};
  report_.accelerations = survey;
  report_.smallest_step = HUGE_VAL;
  report_.slowest = local_ ? 0.0 : HUGE_VAL;
  next_size_ = options_.step;
  if (local_) return start_local_control();
  if (start_control()) return;
  throw Misuse("scene '" + main_.scene().name + "': " + rate_.failure);
}

void AdaptiveIntegrator::restart(double time, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v) {
  main_.restart(time, q, p, v);
  v_ = v;
  if (local_) return go_on_local_control();
  if (!start_control()) throw Misuse("scene '" + main_.scene().name + "': " + rate_.failure);
}

double AdaptiveIntegrator::span() const {
  const double start = main_.scene().start.time;
  return std::abs(adaptive_.end.value_or(start + 100.0 * options_.step) - start);
}

double AdaptiveIntegrator::largest_rate() const {
  const double smallest = adaptive_.smallest_step > 0.0 ? adaptive_.smallest_step : 1e-9 * span();
  return adaptive_.eps / smallest;
}

StepReport AdaptiveIntegrator::failed(const std::string& what) const {
  StepReport report;
  report.solve.status = SolveStatus::no_convergence;
  report.step = work().steps;
  report.time = time();
  report.failure = "step " + std::to_string(report.step) + " from t = " + to_text(report.time) + ": " + what;
  return report;
}

void AdaptiveIntegrator::note(double size) {
  report_.smallest_step = std::min(report_.smallest_step, std::abs(size));
  report_.largest_step = std::max(report_.largest_step, std::abs(size));
}

StepReport AdaptiveIntegrator::step() {
  if (work().steps >= adaptive_.max_steps)
    return failed(std::to_string(adaptive_.max_steps) +
                  " steps did not reach the end; take a larger eps, a fixed step, or more steps");
  if (local_) return error_step();
  const long before = meter_->motion().accelerations();
  StepReport report;
  if (adaptive_.control == StepControl::in_step) {
    double whole = 0.0;
    for (std::size_t part = 0; part < fractions_.size(); ++part) {
      double size = 0.0;
      Sizes& last = last_sizes_[part];
      // Sizes change by about the same factor from step to step.
      const double guess = last.newest * std::clamp(last.newest / last.older, 0.5, 2.0);
      report = solve_size(sign_ * fractions_[part] * adaptive_.eps, guess, size);
      if (!report.ok()) return report;
      last = {size, last.newest};
      whole += size;
    }
    next_size_ = whole;
    note(whole);
  } else {
    report = control_step(next_size_);
  }
  report_.accelerations += meter_->motion().accelerations() - before;
  return report;
}

StepReport AdaptiveIntegrator::sample_at(double t, Momentum momentum, Sample& sample) {
  const double size = t - time();
  if (!(std::abs(size) <= 2.0 * std::abs(next_size_)))
    throw Misuse("t = " + to_text(t) + " is more than two steps from the last node, t = " + to_text(time()));
  if (size != 0.0)
    return sample_from(time(), main_.position(), main_.momentum(), local_ ? main_.velocity_estimate() : v_, t,
                       momentum, sample);
  StepReport report;
  report.solve = main_.sample(momentum, sample);
  if (!report.ok())
    report.failure = "reading the state at t = " + to_text(t) + ": " + describe(report.solve.status);
  return report;
}

StepReport AdaptiveIntegrator::sample_from(double node, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v,
                                           double t, Momentum momentum, Sample& sample) {
  side_.restart(node, q, p, v);
  kinks_beside_ = false;
  if (!local_) ++report_.side_steps;
  StepReport report;
  if (local_)
    report = side_steps_to(t);
  else if (t != node)
    report = side_.step(t - node);
  kinks_beside_ = kinks_beside_ || (report.ok() && side_.met_kinks());
  if (!local_ && report.ok() && !side_.kinks_passed().empty()) report = side_steps_behind_kinks(t);
  if (!report.ok()) return report;
  report.solve = side_.sample(momentum, sample);
  sample.time = t;
  if (!report.ok())
    report.failure = "reading the state at t = " + to_text(t) + ": " + describe(report.solve.status);
  return report;
}

std::vector<PlanLine> AdaptiveIntegrator::plan() const {
  std::vector<PlanLine> lines = main_.plan();
  if (local_) {
    lines.push_back({"step size", "by the local error",
                     "a step and two halves of it differ by less than " + to_text(adaptive_.eps) +
                         " of q and p; not reversible, as the method"});
    return lines;
  }
  const bool integrating = adaptive_.control == StepControl::integrating;
  lines.push_back({"step size",
                   integrating                                 ? "integrating controller"
                   : adaptive_.control == StepControl::in_step ? "equation in the step"
                                                               : "eps/ω at the node",
                   "eps = " + to_text(adaptive_.eps) + " radians"});
  lines.push_back({"monitor", meter_->generic() ? "generic" : "the user's own",
                   meter_->generic() ? "ω0 = " + to_text(meter_->scales().typical) +
                                           ", ω_min = " + to_text(meter_->scales().lowest)
                                     : "even in v at the start"});
  return lines;
}

}  // namespace diracstep
