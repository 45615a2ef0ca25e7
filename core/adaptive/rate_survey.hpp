#pragma once

#include <algorithm>
#include <diracstep/core/adaptive/rate_monitor.hpp>
#include <diracstep/core/integrator/integrator_options.hpp>
#include <memory>
#include <string>

namespace diracstep {

/// What a coarse run over the first part of a motion finds: Runge and Kutta's classical method on the
/// underlying ordinary differential equation, 0.3 radians a step, constraints left to drift.
struct RateSurvey {
  /// For the generic monitor.  ω0: median over time of |a|/|v|; ω_min: 0.3 of the median of ω, or 0.3 radians
  /// over the whole span where nothing changes at all, or where ω fell by more than 100 within a thousandth
  /// of the span and the survey, then made longer once, did not get further.
  MonitorScales scales;
  double slowest = 0.0;  ///< smallest and largest ω met, ω_min left out
  double fastest = 0.0;
  double covered = 0.0;  ///< time surveyed
  long accelerations = 0;
  std::string failure = {};  ///< empty, or why the survey ended early

  /// max ω / min ω, both at least ω_min.
  double ratio() const { return std::max(1.0, fastest / std::max(slowest, scales.lowest)); }
  /// Above a ratio of 5 they take less time than fixed ones (bench/adaptive_steps).
  bool variable_steps_pay() const { return ratio() > 5.0; }
};

/// Steps that tell whether variable steps pay, and the scales to choose them by.
inline constexpr long survey_steps = 400;

/// Surveys from the start towards `end`, at most `max_steps` steps, or 8 times as many after a
/// start at rest under a force that begins like a power of the time.  Throws Misuse for an end that is the
/// start or not finite, and for a Lagrangian linear in v.
RateSurvey survey_rate(const Scene& scene, const SolverFactory& solvers, double end,
                       long max_steps = survey_steps);

/// What a plan says of variable steps, by a survey to `end`: whether they pay beside fixed ones of the size
/// `step`, or why that is not known.  `how` is how the user asks for them.
PlanLine variable_steps_line(const std::shared_ptr<const Scene>& scene, const SolverFactory& solvers,
                             double end, double step, const std::string& how);

}  // namespace diracstep
