#pragma once

#include <chrono>
#include <cmath>
#include <diracstep/core/adaptive/convergence.hpp>
#include <diracstep/core/adaptive/end_errors.hpp>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/adaptive/force_survey.hpp>
#include <diracstep/core/adaptive/search_run.hpp>
#include <diracstep/core/runs/rest_sizes.hpp>
#include <utility>

namespace diracstep::detail {

/// Repeats one motion with finer and finer steps of one kind, fixed or variable.
class RefinementSearch {
 public:
  using Clock = std::chrono::steady_clock;
  struct Motion {
    std::shared_ptr<const Scene> scene;
    const Registry& registry;
    const SolverFactory& solvers;
    double end;
    const ErrorControlOptions& options;
    MonitorScales scales;
    bool may_compensate;  ///< sums, where round-off stops the search
    Clock::time_point started;
  };

  /// `report` has the method and the kind of steps; the coarsest run has steps of `first`, or eps.
  RefinementSearch(const Motion& motion, ErrorControlReport& report, double first);

  /// To the first observed order, with at most so many solves; false where there is none.  Nothing is
  /// accepted or surveyed yet.
  bool measure(long max_solves);
  /// To the error asked for or a refusal; goes on after measure().
  void go();
  /// Solves that a run needs which meets the error, by the last estimate.
  double predicted_solves() const;
  bool converged() const { return convergence_.accepted(); }

 private:
  enum class Outcome { counts, does_not_count, failed, sticks, ended };
  /// A run that counts.
  struct Counted {
    long refinement, steps;
    Sample end;
  };
  /// What one run left.
  struct Passed {
    Outcome outcome = Outcome::counts;
    Work work = {};
    Sample end = {};
    std::string doubt = {};
  };
  bool next(long max_solves);
  bool conclude();
  Passed pass(long refinement, ErrorControlRun& now, std::vector<PathPoint>* path);
  Outcome run(long refinement);
  void judge(ErrorControlRun& last);
  void confirm();
  void begin_anew(long refinement);
  bool compensate();
  double difference(const Sample& fine, const Sample& coarse) const;
  ErrorControlReport::Steps steps_of(long refinement) const;
  /// Radians fall like the refinement; a local error falls so that the sizes of the steps do.
  double eps_of(long refinement) const {
    const double fine = first_ * static_cast<double>(unit_) / static_cast<double>(refinement);
    return local_ ? std::pow(fine, report_.order + 1) : fine;
  }
  void count(ErrorControlRun& now, const Work& work);
  bool time_is_up() const;
  bool kinks_on_the_way() const;
  bool ramps_of_time() const;
  bool reached_end(double t) const;
  bool stopped(long max_solves);
  bool survey(bool accepted);
  void see_sizes(const Sample& node);
  void add_to_path(const Sample& point, std::vector<PathPoint>& path) const;
  double part_left_at_end() const;
  std::vector<PathPoint> path_of(long refinement);
  void divide(const ForceSurveyReport& found);
  bool accept();
  std::pair<Sample, Sample> run_beside(const Counted& run);
  double amplification(const Counted& run);
  double amplified_round_off(bool accepted);
  bool refuse_unless_amplified(const std::string& why);
  std::string amplified(double left) const;
  bool refuse(const std::string& why);

  const Motion& motion_;
  ErrorControlReport& report_;
  bool local_;  ///< variable steps by their local error, of which the error at the end is no power
  Convergence convergence_;
  StepPlan plan_;
  double first_;
  double eps_step_ = 0.0;  ///< of the options of variable steps, with its sign
  long unit_;  ///< refinement of the coarsest run: above 1 there are sizes between those of two runs
  long refinement_, last_steps_ = 0, last_refinement_ = 1;
  Counted coarsest_{};                ///< of the runs that count
  std::vector<PathPoint> path_ = {};  ///< of that run, or of the last one with variable steps
  std::vector<Counted> last_ = {};    ///< the last three runs that count, the finest at the end
  WaySize positions_ = {}, momenta_ = {}, velocities_ = {};
  Vector sizes_of_q_ = {}, sizes_of_v_ = {};  ///< the largest of each at the nodes read
  RestSizes rest_;
  int failures_ = 0, stuck_ = 0, divisions_ = 0;
  double growth_ = 0.0;             ///< of errors, where it has been asked for
  double rounding_of_times_ = 0.0;  ///< ForceSurveyReport::rounding of the last survey
  bool surveyed_ = false, ended_ = false, measuring_ = false, accepted_ = false;
  std::string fast_;   ///< empty, or where the forces change fast
  std::string doubt_;  ///< empty, or what the checks of a run say of the last one
};

}  // namespace diracstep::detail
