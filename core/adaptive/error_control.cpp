#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/damping_survey.hpp>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/adaptive/rate_survey.hpp>
#include <diracstep/core/adaptive/refinement_search.hpp>
#include <diracstep/core/methods/default_method.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/shown_times.hpp>
#include <utility>

namespace diracstep {
namespace {

using detail::RefinementSearch;

constexpr double cost_of_variable = 2.5;       // of a variable step beside a fixed one of the same method
constexpr double variable_over_median = 15.0;  // of max ω, from which they do: at 5 to 11 either kind may win
constexpr double lowest_of_median = 0.3;       // MonitorScales::lowest
constexpr double ratio_beside_explicit = 100.0;  // max ω / min ω from which variable steps may save any time
constexpr double error_near_round_off = 1e-11;
constexpr double first_parts = 10.0;       // of the work allowed, of which the first run takes one
constexpr double most_over_median = 30.0;  // of the rate that the first fixed step follows

/// Adds the work of a search that was given up.
void add_work(Work& all, const Work& part) {
  all.steps += part.steps;
  all.solves += part.solves;
  all.iterations += part.iterations;
  all.residual_evaluations += part.residual_evaluations;
  all.jacobian_evaluations += part.jacobian_evaluations;
}

/// Coarse steps of both kinds, from which the search starts.
struct FirstSteps {
  double fixed, eps;
  double fixed_solves;  ///< of a coarse run that resolves the fastest part of the motion
};

FirstSteps first_steps(const ErrorControlOptions& options, const RateSurvey& survey, int order, double span) {
  // Radians: coarse, since the runs that follow are finer by 2 and more.
  const double accuracy = std::pow(options.error, 1.0 / order);
  const double radians = std::clamp(12.0 * accuracy, 0.05, 4.0);
  double step = options.first_step > 0.0 ? options.first_step : span / 20.0;
  // Where a force jumps the fastest rate is without meaning; coarse runs that are too coarse cost little.
  const double median = survey.scales.lowest / lowest_of_median;
  if (options.first_step <= 0.0 && survey.fastest > 0.0)
    step = std::min(step, radians / std::min(survey.fastest, most_over_median * median));
  // However little work is allowed, the first runs fit into it, and their answer has an estimated error.
  if (options.first_step <= 0.0)
    step =
        std::max(step, std::min(span / 20.0, first_parts * span / static_cast<double>(options.max_solves)));
  return {step, std::clamp(5.0 * accuracy, 0.02, 1.2), span * survey.fastest / radians};
}

/// A search with both kinds of steps, until coarse runs have measured which needs less; the other's work
/// counts.
ErrorControlReport search_both(const RefinementSearch::Motion& motion, const ErrorControlReport& prepared,
                               FirstSteps first) {
  ErrorControlReport variable = prepared, fixed = prepared;
  variable.adaptive = true;
  fixed.adaptive = false;
  RefinementSearch by_variable(motion, variable, first.eps), by_fixed(motion, fixed, first.fixed);
  const bool measured = by_variable.measure(motion.options.max_solves);
  const double of_variable = measured ? cost_of_variable * by_variable.predicted_solves() : HUGE_VAL;
  const bool there = by_variable.converged();
  const bool fixed_is_dearer = there || (measured && first.fixed_solves > of_variable);
  const double of_fixed = !fixed_is_dearer && by_fixed.measure(motion.options.max_solves)
                              ? by_fixed.predicted_solves()
                              : HUGE_VAL;
  const bool take_variable = measured && (fixed_is_dearer || of_variable < of_fixed);
  ErrorControlReport& taken = take_variable ? variable : fixed;
  const Work other = (take_variable ? fixed : variable).work;
  if (there)
    taken.reason += "; coarse runs with variable steps agree already";
  else if (fixed_is_dearer)
    taken.reason += "; a fixed step would take more solves";
  else if (measured)
    taken.reason += "; measured, a run to the error would cost " + to_text(of_variable, 3) +
                    " with variable steps, " + to_text(of_fixed, 3) + " with fixed ones";
  else
    taken.reason += "; variable steps did not get there: " + variable.refusal;
  (take_variable ? by_variable : by_fixed).go();
  add_work(taken.work, other);
  if (taken.ok() || !take_variable) return taken;
  fixed.refusal.clear();
  fixed.reason = prepared.reason + "; variable steps did not get there: " + taken.refusal;
  by_fixed.go();
  if (fixed.end.q.size() == 0) return taken;  // no time was left
  add_work(fixed.work, variable.work);
  return fixed;
}

/// Whether variable steps may take so much less time that it pays to measure it: their number goes with the
/// mean rate, that of fixed ones with the largest.
bool variable_steps_may_pay(const RateSurvey& survey, bool explicit_steps) {
  if (explicit_steps) return survey.ratio() > ratio_beside_explicit;
  return survey.variable_steps_pay() &&
         survey.fastest * lowest_of_median > variable_over_median * survey.scales.lowest;
}

/// What is decided before the search, beside what its report says.
struct Choice {
  bool may_compensate = false;  ///< sums, where round-off shows
  bool explicit_steps = false;
};

/// The method and its order, and whether sums are compensated: for small errors, where the library chooses.
Choice choose_method(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                     const SolverFactory& solvers, double end, const ErrorControlOptions& options,
                     ErrorControlReport& report) {
  if (options.method != automatic_method) {
    const MethodInfo info = registry.method(options.method).info;
    report.method = info.name;
    report.order = options.order == 0 ? info.order : options.order;
    report.compensated_sums = options.compensated_sums.value_or(false);
    return {};
  }
  const DefaultMethod choice =
      default_method_of_motion(scene, registry, solvers, end, options.first_step, options.integrator,
                               {.order = options.order,
                                .error = options.error,
                                .rule = options.integrator.constraint_rule,
                                .large = large_from(options.integrator.dense_limit)});
  const MethodInfo info = registry.method(choice.method).info;
  const bool may_compensate = !options.compensated_sums && info.stages > 0 && has_accelerations(*scene) &&
                              !scene->space;  // steps on groups have no compensated sums
  report.method = choice.method;
  report.order = choice.order == 0 ? info.order : choice.order;
  report.method_reason = choice.reason;
  report.compensated_sums =
      options.compensated_sums.value_or(may_compensate && options.error < error_near_round_off);
  return {may_compensate, choice.explicit_steps};
}

}  // namespace

ErrorControlReport solve_to_error(const std::shared_ptr<const Scene>& given, const Registry& registry,
                                  const SolverFactory& solvers, double end,
                                  const ErrorControlOptions& options) {
  if (!(options.error > 0.0) || !(options.error < 1.0))
    throw Misuse("error = " + to_text(options.error, 3) + "; a relative error between 0 and 1 is needed");
  const auto scene = completed(given);
  const bool accelerates = has_accelerations(*scene);
  ErrorControlReport report;
  const Choice choice = choose_method(scene, registry, solvers, end, options, report);
  const bool damped = registry.method(report.method).info.damped;
  RateSurvey survey;
  if (accelerates && !damped) survey = survey_rate(*scene, solvers, end);
  const FirstSteps first = first_steps(options, survey, report.order, std::abs(end - scene->start.time));
  const RefinementSearch::Motion motion{scene,
                                        registry,
                                        solvers,
                                        end,
                                        options,
                                        survey.scales,
                                        choice.may_compensate,
                                        RefinementSearch::Clock::now()};
  report.reason = options.adaptive          ? "as asked for"
                  : damped                  ? "by their local error, as the damping family allows"
                  : options.monitor.rate    ? "a monitor is given"
                  : !accelerates            ? "there are no accelerations to choose variable steps by"
                  : !survey.failure.empty() ? "how fast it changes is not known: " + survey.failure
                                            : "max ω / min ω = " + to_text(survey.ratio(), 3);
  const bool may_pay = accelerates && !damped && survey.failure.empty() &&
                       (options.monitor.rate || variable_steps_may_pay(survey, choice.explicit_steps));
  if (!options.adaptive && may_pay) return search_both(motion, report, first);
  report.adaptive = options.adaptive.value_or(damped);
  RefinementSearch(motion, report, report.adaptive ? first.eps : first.fixed).go();
  return report;
}

RunReport run_again(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                    const SolverFactory& solvers, const ErrorControlReport& report, Momentum momentum,
                    long every, const Observer& observer) {
  if (every < 1) throw Misuse("every = " + std::to_string(every) + "; 1 or more is needed");
  Work work;
  RunReport done;
  Sample sample;
  long node = 0;
  const auto at_node = [&](const detail::ReadNode& read, bool last) {
    if (node++ % every != 0 && !last) return true;
    return read(momentum, sample).ok() && observer(sample);
  };
  done.last = detail::run_steps_of(completed(scene), registry, solvers, report.steps, report.adaptive,
                                   report.end.time, work, at_node)
                  .last;
  return done;
}

RunReport run_again_at(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                       const SolverFactory& solvers, const ErrorControlReport& report, Momentum momentum,
                       std::vector<double> times, const Observer& observer) {
  const std::shared_ptr<const Scene> stepped = completed(scene);
  IntegratorOptions options = report.steps.integrator;
  options.method = report.method;
  options.order = report.order;
  if (!report.adaptive) options.step = report.step;
  Integrator beside(stepped, registry, solvers, options);
  ShownTimes shown(std::move(times), stepped->start.time, options.step, observer);
  Work work;
  RunReport done;
  Sample from, last, here;
  StepReport reading;
  long steps = 0;
  const auto between = [&](double t, Sample& sample) {
    beside.restart(from.time, from.q, from.p, from.v);
    StepReport step = beside.step(t - from.time);
    if (step.ok()) step.solve = beside.sample(momentum, sample);
    return step;
  };
  const auto at_node = [&](const detail::ReadNode& read, bool ends) {
    reading.solve = read(Momentum::projected, here);
    // Points of one step are the kinks that it crosses and its end; the last variable one is not taken.
    const bool begun = last.q.size() > 0, of_a_new_step = work.steps != steps || (ends && report.adaptive);
    steps = work.steps;
    if (begun && of_a_new_step) from = last;
    if (begun && reading.ok()) reading = shown.before(here.time, options.step, between);
    if (reading.ok())
      reading = shown.up_to(here.time, options.step, [&](double, Sample& sample) {
        StepReport point;
        point.solve = read(momentum, sample);
        return point;
      });
    std::swap(last, here);
    return reading.ok() && shown.wanted();
  };
  done.last = detail::run_steps_of(stepped, registry, solvers, report.steps, report.adaptive, report.end.time,
                                   work, at_node)
                  .last;
  if (done.ok()) done.last = reading;
  return done;
}

}  // namespace diracstep
