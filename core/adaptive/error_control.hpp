#pragma once

#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/adaptive/step_plan.hpp>
#include <diracstep/core/runs/run.hpp>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace diracstep {

/// The error asked for, and how far the search may go.
struct ErrorControlOptions {
  static constexpr long usual_max_solves = 1'000'000;
  static constexpr double usual_max_time = 30.0;

  double error = 0.0;  ///< asked for at the end of the motion, see ErrorControlReport::estimate
  std::string method = automatic_method;  ///< "auto": default_method_of_motion() for this error
  int order = 0;  ///< as in IntegratorOptions; without a method, the one of default_method()
  std::optional<bool> adaptive = {};  ///< empty: where a survey finds max ω > 5 min ω and coarse runs of both
                                      ///< kinds measure that variable steps need fewer solves; with the
                                      ///< damping family always, by their local error
  Monitor monitor = {};  ///< for variable steps; empty: the generic one
  StepControl control = StepControl::integrating;
  double first_step = 0.0;                    ///< of a fixed step, without sign; 0: from the survey
  std::optional<bool> compensated_sums = {};  ///< empty: where the library chooses the method and the error
                                              ///< is below 1e-11, or round-off stops the search without them
  IntegratorOptions integrator = {};          ///< the rule of rows and all else that is not said above
  long max_solves = usual_max_solves;         ///< nonlinear systems, or explicit steps; where fixed and
                                              ///< variable steps are both tried, of each
  double max_time = usual_max_time;           ///< seconds on the clock in all
  std::function<bool()> go_on = {};           ///< asked within each run; false ends the search
};

/// One run of the search.
struct ErrorControlRun {
  double step = 0.0;  ///< its size, the mean where it is not one; eps for variable steps
  long steps = 0;
  long solves = 0;
  double difference = std::numeric_limits<double>::quiet_NaN();      ///< from the run before it
  double estimate = std::numeric_limits<double>::quiet_NaN();        ///< of its error
  double observed_order = std::numeric_limits<double>::quiet_NaN();  ///< from it and the two runs before it
  std::string failure = {};  ///< empty, or why it stopped or does not count
};

/// What was reached, and every run on the way there.
struct ErrorControlReport {
  std::string refusal;  ///< empty, or why the error asked for was not reached
  std::string warning;  ///< empty, or why the estimate deserves less trust
  std::string method;
  std::string method_reason;  ///< of default_method(), empty where a method was given
  int order = 0;
  bool adaptive = false;
  std::string reason;    ///< why steps vary or do not
  std::string division;  ///< empty, or where the motion was divided for what the forces do there
  double step = 0.0;     ///< of the accepted run, with its sign, the mean where it is not one; eps for
                         ///< variable steps
  bool compensated_sums = false;
  Sample end;  ///< of the accepted run, or of the last good one; p projected
  /// Of the error of `end`: relative maximum norm, the largest of those of q, p and v, absolute where a
  /// column is zero.  Never below the round-off of the run, 2.2e-16 √steps: runs that agree to the bit prove
  /// no more.
  double estimate = std::numeric_limits<double>::quiet_NaN();
  double observed_order = std::numeric_limits<double>::quiet_NaN();  ///< NaN where the runs differ by
                                                                     ///< round-off alone
  std::string grounds;  ///< why the estimate of an accepted run is believed, as "observed order 8.0"
  Work work;            ///< of all runs, output included
  std::vector<ErrorControlRun> runs;

  /// What repeats the run that `end` is of: see run_again().
  struct Steps {
    IntegratorOptions integrator;
    AdaptiveOptions variable;  ///< where the steps vary
    StepPlan plan;             ///< where they do not
    long refinement = 1;
  } steps;

  bool ok() const { return refusal.empty(); }
};

/// Finds a method and a step with which the error at `end` is below the one asked for.
///
/// The motion is repeated with finer and finer steps, from h_a to h_b, and the error of the finer of two runs
/// is estimated by Richardson's  |y_a − y_b| / ((h_a/h_b)^p − 1).  A run is accepted by the rules of
/// Convergence, and after a survey of the forces along the motion (ForceSurvey) that finds nothing which the
/// steps do not resolve.  Where it finds a switch or a pulse, the motion is divided there and the search
/// begins anew, always with fixed steps.  Two runs with the same steps, or of fewer than four variable
/// ones, prove nothing and do not count.  Local error estimates say nothing of the error at the end and are
/// not used for it.
///
/// The search is refused, with the reason and the best answer so far, where the differences stop falling at
/// round-off, where the forces change too fast, where steps fail at every size, or where the work or the time
/// is used up or is foreseen to be.
///
/// Throws Misuse for an error that is not in (0, 1), and as the integrators do.
ErrorControlReport solve_to_error(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                                  const SolverFactory& solvers, double end,
                                  const ErrorControlOptions& options);

/// Repeats the run that a report's `end` is of, bit by bit, and shows the start, every `every`-th node and
/// the end to the observer.
RunReport run_again(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                    const SolverFactory& solvers, const ErrorControlReport& report, Momentum momentum,
                    long every, const Observer& observer);

/// Repeats it and shows the motion at these times instead, those between two nodes by a step of the method
/// from the first of both: the error that was asked for is that of the end.  Throws Misuse for times out of
/// order.
RunReport run_again_at(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                       const SolverFactory& solvers, const ErrorControlReport& report, Momentum momentum,
                       std::vector<double> times, const Observer& observer);

}  // namespace diracstep
