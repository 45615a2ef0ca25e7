#pragma once

#include <diracstep/core/methods/registry.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/validation/studies/linear_stability.hpp>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace diracstep {

/// Something that a run is watched for: a function of the point that keeps its start value on the true
/// motion, or nearly so.
struct WatchedQuantity {
  std::string name;  ///< "energy"
  std::function<double(double t, ConstVectorRef q, ConstVectorRef v)> at;
  double scale = 1.0;    ///< deviations are divided by this
  double bound = 0.5;    ///< a larger relative deviation is no longer bounded
  bool only_up = false;  ///< a loss is no deviation: the energy of a dissipative scene
};

/// One scene made stiff or extreme, with the step it is run at.
struct StabilityCase {
  std::string group;     ///< cases that differ in one number: "stiff_spring_pendulum, k"
  double value = 0.0;    ///< that number
  std::string name;      ///< "stiff_spring_pendulum k=1e6"
  CatalogueScene scene;  ///< its reference judges the end, where it has one there
  double step = 0.0;
  double t_end = 0.0;
  std::vector<WatchedQuantity> watches = {};
  double accuracy = 1e-3;  ///< a smaller relative error at the end is called accurate
};

/// How a run ended.
enum class StabilityOutcome {
  accurate,  ///< at the end, and right there to the case's accuracy
  bounded,   ///< at the end, every watch within its bound
  doubted,   ///< at the end, and RunChecks doubts the result
  stopped,   ///< a step or the reading of a point failed and said so
  refused,   ///< not begun: the library threw Misuse, or the method does not take the scene
  wrong      ///< at the end without a warning, and none of the above
};
const char* name(StabilityOutcome outcome);

/// What a watch saw.  Deviations are relative to its scale; NaN where no point was read.
struct WatchResult {
  std::string name;
  double band = std::nan("");              ///< largest deviation
  double drift = std::nan("");             ///< slope of the deviation over time, of the means of 20 blocks
  double drift_half_width = std::nan("");  ///< half the 95 % confidence interval of that slope (Student's t)
  double bounded_until = std::nan("");     ///< time of the last point before the bound was passed

  /// Whether zero lies outside the confidence interval of the slope.
  bool drifts() const { return std::abs(drift) > drift_half_width; }
};

/// IDA on the same case at one tolerance.
struct IdaBeside {
  double rtol = 0.0;
  std::string status = "ok";
  double error = std::nan("");       ///< as for our rows
  double deviation = std::nan("");   ///< largest relative deviation of a watch at the end
  double constraint = std::nan("");  ///< |φ| and |A v + b| at the end
  double cpu_seconds = std::nan("");

  bool ok() const { return status == "ok"; }
};

/// One method on one case.
struct StabilityRow {
  std::string method;
  int order = 0;
  StabilityOutcome outcome = StabilityOutcome::refused;
  std::string message = {};  ///< what was said
  long steps = 0;
  double t_reached = std::nan("");
  std::vector<WatchResult> watches = {};
  double constraint = std::nan("");  ///< largest |φ| and |A v + b| at the points read
  double error = std::nan("");       ///< relative maximum norm over q and projected p at the end
  long failed_solves = 0;            ///< steps that Newton did not solve
  long newton_iterations = 0;
  double cpu_seconds = std::nan("");
  std::optional<IdaBeside> ida = {};  ///< the tightest tolerance that cost no more, or the cheapest run
};

struct StabilityResult {
  StabilityCase that;
  std::vector<StabilityRow> rows;
  std::vector<IdaBeside> ida;  ///< every tolerance run
};

/// One method, uncomposed (order 0) or composed.
struct StabilityMethod {
  std::string name;
  int order = 0;
};

/// Called before and within each run with the part done, 0 to 1, and what is run; false ends the study, the
/// run at hand being left out.
using StabilityObserver = std::function<bool(double part, const std::string& what)>;

/// Runs one method on one case; the points read are about 400, evenly spread.  `going_on` is asked at each
/// and ends the run there by false.
StabilityRow run_stability_case(const StabilityCase& that, const Registry& registry,
                                const SolverFactory& solvers, const StabilityMethod& method,
                                const std::function<bool()>& going_on = {});

/// Every method on every case, and IDA at tolerances 1e-3, 1e-4, … as long as a run takes no more CPU time
/// than the longest of ours.
std::vector<StabilityResult> stability_study(const std::vector<StabilityCase>& cases,
                                             const Registry& registry, const SolverFactory& solvers,
                                             const std::vector<StabilityMethod>& methods, bool with_ida,
                                             const StabilityObserver& observer);

}  // namespace diracstep
