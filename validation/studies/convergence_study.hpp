#pragma once

#include <array>
#include <diracstep/validation/studies/study_run.hpp>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace diracstep {

/// "plus", "minus" or "projected".
const char* name(Momentum momentum);

/// The orders a study runs a method at: its own and, for methods of order 1 and 2, those of its compositions.
std::vector<int> possible_orders(const MethodInfo& method);

struct StudyOptions {
  std::vector<std::string> methods = {"type1/midpoint"};  ///< "auto" is default_method()
  std::vector<int> orders = {};                           ///< empty: all possible ones of each method
  /// Methods at an order each, instead of both lists above; one that the scene does not take is left out.
  std::vector<std::pair<std::string, int>> series = {};
  std::vector<double> steps = {};  ///< empty: a ladder, see convergence_study
  bool adaptive = false;           ///< also variable steps, with a ladder of eps, for methods that allow them
  /// Tolerances of the baselines; empty: no runs of theirs.
  std::vector<double> rtols = {1e-2, 1e-3,  1e-4,  1e-5,  1e-6,  1e-7, 1e-8,
                               1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14};
  std::vector<std::string> baselines = {ida_method, erk_method};  ///< beside the methods
  std::optional<DaeFormulation> ida_formulation = {};             ///< empty: best_formulations() of the scene
  int repeats = 5;  ///< timed runs of each row; long runs take fewer
  Momentum momentum = Momentum::projected;
  std::optional<double> t_end = {};              ///< instead of the scene's
  std::optional<StepRule> constraint_rule = {};  ///< instead of the method's own
  double run_budget = 1.0;      ///< CPU seconds: a ladder ends where its next run is expected to take longer
  double smallest_error = 0.0;  ///< ladders end below it: what is smaller is of no interest
  double reference_budget = 20.0;  ///< CPU seconds for a reference of our own, see converged_reference(), and
                                   ///< as many for one by IDA where there is none, at least those of a run
  /// CPU seconds for the whole study, shared out evenly over its ladders as they come: what one
  /// does not need the others have.  A ladder whose next rows would take longer ends there.
  double time_limit = std::numeric_limits<double>::infinity();
};

/// What the rows of one method and order show: the order, if it can be read off, and why the ladder ended.
struct MeasuredOrder {
  std::string method;
  int order;
  std::optional<double> slope;
  int points;  ///< that the slope rests on
  std::string ladder_end;
};

/// CPU time to reach an error, for one method and order and for the baselines; empty where a side does not
/// get there.
struct AtError {
  double error = 0.0;
  std::string method;
  int order = 0;
  bool best = false;                       ///< the fastest of ours at this error
  std::optional<double> cpu_seconds = {};  ///< an upper bound where the coarsest run is below the error
  std::optional<double> ida_cpu_seconds = {};
  std::optional<double> ratio = {};  ///< IDA's time over ours
  std::optional<double> erk_cpu_seconds = {};
  std::optional<double> erk_ratio = {};  ///< the explicit method's time over ours
};

/// The errors `at_error` is taken at.
inline constexpr std::array<double, 4> compared_errors{1e-3, 1e-6, 1e-9, 1e-11};

struct Study {
  std::string scene;
  Parameters parameters;
  double t_start = 0.0;
  double t_end = 0.0;
  int unknowns = 0;  ///< coordinates and multipliers of a step
  Momentum momentum = Momentum::projected;
  std::string reference_kind;  ///< "exact", "published", "own", "converged" or "ida"
  std::string reference_how;
  double reference_error = 0.0;  ///< its own; nothing is read off an error below it.  NaN: not known
  std::vector<StudyRow> rows;
  std::vector<MeasuredOrder> measured_orders;
  std::vector<AtError> at_error;
  bool interrupted = false;
};

/// Called before every run and now and then within ours, with the part done, from 0 to 1, and what is under
/// way; false ends the study, which then holds the rows finished so far.
using StudyObserver = std::function<bool(double part, const std::string& what)>;

/// Error against CPU time at t_end for every (method, order), and for the baselines.  A scene with events
/// that act or stop is run through them, by steps of one size, and without the baselines, which know none.
///
/// Errors are relative maximum norms, absolute where the reference is zero; that of p is taken against ∂L/∂v
/// of the reference.  A scene without a reference at t_end is measured against converged_reference() or,
/// where that does not come to an end, against IDA at the tolerance 1e-13.
///
/// CPU time is that of the thread: the start, all steps and the final reading of the state.  Construction is
/// left out, and so are the errors and any output.  One warm-up run comes first; the median is over `repeats`
/// runs, of which runs above 0.03 s take fewer, and one above 0.1 s is its own warm-up.
///
/// Without given steps each (method, order) has a ladder.  It starts at the scene's natural step, coarser as
/// long as the error is below 1e-2, and is refined by factors 2 (√2 above order 4, which cross the useful
/// errors in few steps) until the error reaches that of the reference or stops falling at round-off, or the
/// run budget is used up.
///
/// A run that fails is a row with the reason as its status; so is a method that does not fit the scene.
/// Throws Misuse for options that allow no run at all.
Study convergence_study(const CatalogueScene& scene, const Registry& registry, const SolverFactory& solvers,
                        const StudyOptions& options, const StudyObserver& observer = {});

/// About how many CPU seconds a study with these options takes, from the time of a few steps.
double expected_seconds(const CatalogueScene& scene, const Registry& registry, const SolverFactory& solvers,
                        const StudyOptions& options);

/// Times the reference's own error: what is smaller shows the error of the reference.
inline constexpr double near_the_reference = 3.0;

/// measured_orders and at_error, from the rows.  Errors below that of the reference count as that: runs are
/// compared at larger ones only, and orders are read off those above `near_the_reference` times it.
void conclude(Study& study);

/// Whether a measured order is the stated one, give or take `tolerance`; false where none could be measured.
bool confirms_order(const MeasuredOrder& measured, double tolerance = 0.1);

}  // namespace diracstep
