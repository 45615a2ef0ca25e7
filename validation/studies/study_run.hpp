#pragma once

#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/runs/event_steps.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/validation/references/reference_run.hpp>
#include <functional>
#include <limits>
#include <optional>
#include <string>

namespace diracstep {

/// CPU time of the calling thread over the repeats of one run.
struct CpuSeconds {
  double median = 0.0;
  double min = 0.0;
  double max = 0.0;
  int repeats = 0;
};

/// The method names of the baselines: SUNDIALS IDA, and the fastest explicit code (explicit_reference.hpp).
inline constexpr const char* ida_method = "ida";
inline constexpr const char* erk_method = "erk";

/// What the method names of rows with variable steps end in.
inline constexpr const char* variable_steps = " adaptive";

/// One run of a study.  A number that does not apply or was not reached is NaN.
struct StudyRow {
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();

  std::string method;
  int order = 0;                 ///< 0 for a baseline
  double step = none;            ///< ours: the step size, fitted to the interval, or eps of variable steps
  double rtol = none;            ///< a baseline's
  std::string formulation = {};  ///< of IDA, or the code of the explicit baseline
  std::string status = "ok";
  double error_q = none;
  double error_p = none;
  double self_error = none;  ///< a baseline's: how far its result is from that of the next tighter tolerance
  double constraint = none;  ///< largest |φ(q)| and |A(q)v + b| at the end
  double energy_error = none;  ///< |E(end) − E(start)| / max(|E(start)|, |E(end)|, |p·v|/2 at the end)
  CpuSeconds cpu_seconds = {};
  long steps = 0;
  long newton_iterations = 0;
  long residual_evaluations = 0;
  long jacobian_evaluations = 0;

  bool ok() const { return status == "ok"; }
  bool is_baseline() const { return method == ida_method || method == erk_method; }
  /// False for a method or order that the scene does not admit; nothing was run then.
  bool fits() const { return is_baseline() || step == step; }
  double error() const { return error_q > error_p ? error_q : error_p; }
};

/// The true end of a motion, and where it is known from.
struct ReferenceEnd {
  std::string kind;  ///< "exact", "published", "own", "converged" or "ida"
  std::string how;
  double self_error = StudyRow::none;
  std::string missing;  ///< empty, or why there is no reference
  Vector q;
  Vector p;                                 ///< empty where velocities do not determine it: H is degenerate
  std::shared_ptr<const Space> space = {};  ///< of the scene, null in R^n

  /// The larger of the relative errors in q and p.
  double distance(const Sample& end) const;
};

/// The scene's reference at time t with p = ∂L/∂v; empty where it does not reach t.
std::optional<ReferenceEnd> known_point(const CatalogueScene& scene, double t);

/// The scene's reference at t_end with p = ∂L/∂v, or IDA's result at the tolerance 1e-13 where there is none;
/// `look` is that of ReferenceOptions.
ReferenceEnd reference_end(const CatalogueScene& scene, double t_end, const std::function<void()>& look = {});

/// Largest |φ(q)| and |A(q)v + b| at a point.
double largest_violation(const Scene& scene, const Sample& at);

/// Fills in the errors, the violation of the rows and the change of the energy at the end of a run.  Like
/// run_baseline it needs a scene with a Lagrangian, see completed().
void judge(StudyRow& row, const Scene& scene, const Sample& end, const ReferenceEnd& reference);

/// Called now and then within a run of ours, outside the time taken; may throw to end it.
using Look = std::function<void()>;

/// Runs from the start to the end of `steps` steps, once to warm up and `repeats` times for the clock.  The
/// time of a run holds the start, all steps and the reading of the end; construction is left out.  A run
/// above 0.03 s is repeated less often, and one above 0.1 s is its own warm-up.
StudyRow run_ours(Integrator& integrator, long steps, Momentum momentum, int repeats,
                  const ReferenceEnd& reference, const Look& look = {});

/// The same of a scene with its events (EventSteps), to the end of the steps or to the event that stops it.
/// Rows that are on at the end are those whose violation is told.
StudyRow run_with_events(const CatalogueScene& scene, const Registry& registry, const SolverFactory& solvers,
                         const IntegratorOptions& options, long steps, Momentum momentum, int repeats,
                         const ReferenceEnd& reference, const Look& look = {});

/// The same with variable steps to t_end; the survey of the rate belongs to the construction.  The row's
/// method ends in `variable_steps` and its step is eps.
StudyRow run_variable(AdaptiveIntegrator& integrator, double t_end, Momentum momentum, int repeats,
                      const ReferenceEnd& reference, const Look& look = {});

/// The same for a baseline, by its method name; `end` receives where it got to.
StudyRow run_baseline(const std::string& method, const Scene& scene, double t_end,
                      const ReferenceOptions& options, int repeats, const ReferenceEnd& reference,
                      Sample& end);

}  // namespace diracstep
