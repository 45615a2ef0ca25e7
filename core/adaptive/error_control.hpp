#pragma once

#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace diracstep {

/// The error asked for, and how far the search may go.
struct ErrorControlOptions {
  double error = 0.0;  ///< asked for at the end of the motion, see ErrorControlReport::estimate
  std::string method = automatic_method;  ///< "auto": default_method() for this error
  int order = 0;  ///< as in IntegratorOptions; without a method, the one of default_method()
  std::optional<bool> adaptive = {};          ///< empty: where a survey finds max ω > 5 min ω
  Monitor monitor = {};                       ///< for variable steps; empty: the generic one
  double first_step = 0.0;                    ///< of a fixed step, without sign; 0: from the survey
  std::optional<bool> compensated_sums = {};  ///< empty: where the library chooses the method and the error
                                              ///< is below 1e-8
  long max_solves = 3'000'000;                ///< nonlinear systems in all, or explicit steps
  std::function<bool()> go_on = {};           ///< asked after each run; false ends the search
};

/// One run of the search.
struct ErrorControlRun {
  double step = 0.0;  ///< its size; eps for variable steps
  long steps = 0;
  long solves = 0;
  double difference = std::numeric_limits<double>::quiet_NaN();      ///< from the run before it
  double estimate = std::numeric_limits<double>::quiet_NaN();        ///< of its error
  double observed_order = std::numeric_limits<double>::quiet_NaN();  ///< from it and the two runs before it
  std::string failure = {};                                          ///< empty, or why it stopped
};

/// What was reached, and every run on the way there.
struct ErrorControlReport {
  std::string refusal;  ///< empty, or why the error asked for was not reached
  std::string warning;  ///< empty, or why the estimate deserves less trust
  std::string method;
  std::string method_reason;  ///< of default_method(), empty where a method was given
  int order = 0;
  bool adaptive = false;
  std::string reason;  ///< why steps vary or do not
  double step = 0.0;   ///< of the accepted run, with its sign; eps for variable steps
  bool compensated_sums = false;
  Sample end;  ///< of the accepted run, or of the last good one; p projected
  /// Of the error of `end`: relative maximum norm, the larger of those of q and p, absolute where a column is
  /// zero.
  double estimate = std::numeric_limits<double>::quiet_NaN();
  double observed_order = std::numeric_limits<double>::quiet_NaN();
  Work work;  ///< of all runs, output included
  std::vector<ErrorControlRun> runs;

  bool ok() const { return refusal.empty(); }
};

/// Finds a method and a step with which the error at `end` is below the one asked for.
///
/// The motion is repeated with finer and finer steps, from h_a to h_b, and the error of the finer of two runs
/// is estimated by Richardson's  |y_a − y_b| / ((h_a/h_b)^p − 1)  with the stated order p.  A run is accepted
/// where 2.5 times the estimate is below the error asked for and the order observed over three runs confirms
/// p to within one, or where two refinements in a row changed next to nothing.  Local error estimates say
/// nothing of the error at the end and are not used.  The search is refused, with the reason, where the
/// differences stop falling at round-off, where steps fail at every size, or where the work is used up.
///
/// Throws Misuse for an error that is not in (0, 1), and as the integrators do.
ErrorControlReport solve_to_error(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                                  const SolverFactory& solvers, double end,
                                  const ErrorControlOptions& options);

}  // namespace diracstep
