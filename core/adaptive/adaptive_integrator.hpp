#pragma once

#include <cmath>
#include <diracstep/core/adaptive/local_error.hpp>
#include <diracstep/core/adaptive/rate_monitor.hpp>
#include <diracstep/core/integrator/integrator.hpp>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace diracstep {

/// How the size of the next step is found.
enum class StepControl {
  /// Integrating controller with a guard, explicit and reversible (Hairer and Söderlind, SIAM J. Sci. Comput.
  /// 26, 2005):  z ← ω(y_0) + eps/2 G(y_0), then in each step  h = eps/z,  z ← z + eps G(y),  G = d(ln ω)/dt.
  /// Where (z − eps G/2)/ω(y) leaves [0.8, 1.25], z starts anew from y; that is counted.
  integrating,
  /// An equation in the step, h (ω(y_0) + ω(y_1))/2 = eps, solved for h with the step: reversible without any
  /// state of a controller, so also at coarse eps.  In a composition each part solves its own, with its
  /// fraction of eps.  Takes about four solves where the controller takes one.
  in_step,
  /// h = eps/ω(y_0): not reversible, loses the long-run behaviour.  For comparison only.
  irreversible,
  /// By the local error of a step, eps being the part of q and p that it may be (local_error.hpp).  The
  /// control
  /// of the damping family and of no other: it is not reversible.
  local_error
};

/// "integrating", "in-step", "irreversible" or "local-error".
const char* name(StepControl control);

/// The control of that name; throws Misuse for any other.
StepControl step_control(const std::string& name);

/// How the step size varies.
struct AdaptiveOptions {
  static constexpr double usual_radians = 0.2, usual_local_error = 1e-6;

  /// Radians of a step, or its local error; NaN: the usual ones.
  double eps = std::numeric_limits<double>::quiet_NaN();
  /// For a method of the damping family `integrating`, the default, stands for `local_error`.
  StepControl control = StepControl::integrating;
  Monitor monitor = {};            ///< empty: the generic one
  MonitorScales scales = {};       ///< of the generic monitor; zeros are taken from a survey towards `end`
  std::optional<double> end = {};  ///< where the motion will end, for the survey; 100 steps of the options'
                                   ///< size without it
  double smallest_step =
      0.0;  ///< without sign: ω counts as at most eps over it; 0: 1e-9 of the time to `end`.  Steps by their
            ///< local error are accepted below it whatever their error; 0: never
  double largest_step = 0.0;    ///< of steps by their local error, without sign; 0: any
  long max_steps = 10'000'000;  ///< the next one fails
};

/// What the control did since the start.
struct ControlReport {
  long resets = 0;  ///< of the controller, by its guard: more than one in 1000 steps asks for a smaller eps
  double smallest_step = 0.0, largest_step = 0.0;  ///< without sign
  double slowest = 0.0, fastest = 0.0;             ///< ω at the nodes
  double lowest_ratio = 1.0, highest_ratio = 1.0;  ///< (z − eps G/2)/ω before a reset
  long side_steps = 0;                             ///< for output off the nodes
  long refused = 0;                                ///< steps whose local error was too large, or that failed
  long accelerations = 0;                          ///< linear systems solved for the monitor, survey included
};

/// Steps of varying size: those that keep reversibility, and with it the long-run behaviour of a self-adjoint
/// step, and for the damping family ordinary ones, by their local error.
///
/// Output at times of the user's choice comes from side steps: a second integrator steps from the last node
/// to that time, with the full order of the method, and leaves the main sequence untouched bit by bit.
class AdaptiveIntegrator {
 public:
  /// The sign of options.step is the direction; its size matters for the survey without an end, and for steps
  /// by their local error where it depends on the time or has kinks: those are at most five times it.  Throws
  /// Misuse as Integrator does, for a method that is neither self-adjoint (composed ones are) nor of the
  /// damping family, for a control that is not one of the method's, for a negative eps, and with a
  /// self-adjoint method for a monitor that is not positive or not even in v, and for a Lagrangian linear in
  /// v.
  AdaptiveIntegrator(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                     const SolverFactory& solvers, IntegratorOptions options,
                     const AdaptiveOptions& adaptive);

  /// Goes back to the scene's start.
  void reset();

  /// Goes on from another point of a motion, as Integrator::restart(); the control begins anew there.  The
  /// counts go on.  Throws Misuse where the monitor knows no rate there.
  void restart(double time, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v);

  /// One step of the main sequence.
  StepReport step();

  /// The size of the next step; a prediction where it is solved for in the step.
  double next_size() const { return next_size_; }
  double time() const { return main_.time(); }
  /// Of the main sequence, with the whole steps beside halves of them, which are one step.
  const Work& work() const { return local_ ? local_work_ : main_.work(); }
  const Work& side_work() const { return side_.work(); }
  const ControlReport& control() const { return report_; }
  /// Where the last step crossed kinks in q and v.
  std::span<const KinkPassed> kinks_passed() const { return (whole_ ? *whole_ : main_).kinks_passed(); }
  const Integrator& integrator() const { return main_; }
  const IntegratorOptions& options() const { return options_; }
  const AdaptiveOptions& adaptive() const { return adaptive_; }

  /// Reads the current node.
  SolveReport sample(Momentum momentum, Sample& sample) {
    kinks_beside_ = false;
    return main_.sample(momentum, sample);
  }

  /// Reads the motion at another time by a side step from the current node, or by as many as their local
  /// error asks for.  Full order for times within about a step from there; throws Misuse beyond two steps.
  StepReport sample_at(double t, Momentum momentum, Sample& sample);
  /// The same from another node, such as the one before.
  StepReport sample_from(double node, ConstVectorRef q, ConstVectorRef p, ConstVectorRef v, double t,
                         Momentum momentum, Sample& sample);

  /// The motion from an earlier point to the current node with `part` of the radians, of reversible steps:
  /// what both ends differ by tells what the steps miss.  The main sequence goes on as without.
  StepReport with_finer_steps(double part, const Sample& from, Sample& end);

  /// Whether the way of the side steps from the node to the point read last crossed kinks in q and v.
  bool kinks_beside() const { return kinks_beside_; }

  std::vector<PlanLine> plan() const;

 private:
  void start_local_control();
  void go_on_local_control();
  StepReport error_step();
  StepReport side_steps_to(double t);
  double up_to_instant(double size) const;
  StepReport control_step(double size);
  StepReport solve_size(double eps, double guess, double& size);
  struct PartOfMotion {
    Rate rate;         ///< at its start
    double size, eps;  ///< of its first step, and eps in it
  };
  PartOfMotion begin_part(const Integrator& at, double size_before, bool behind_kink, Vector& v);
  bool agree(double size, double eps);
  double resolved_size(double size, double eps);
  StepReport side_steps_behind_kinks(double t);
  Rate rate_of(const Integrator& at, double size, double ahead, bool growth, Vector& v);
  bool at_kink(double ahead);
  bool measure(bool growth, bool behind_kink);
  double span() const;
  double largest_rate() const;
  bool start_control();
  StepReport failed(const std::string& what) const;
  void note(double size);

  ControlReport report_;
  IntegratorOptions options_;  ///< as given: a composition's order
  AdaptiveOptions adaptive_;
  std::vector<double> fractions_;  ///< of eps, where each part of a composition solves for its size
  Integrator main_, side_;
  std::optional<LocalErrorControl> local_;  ///< one of the two
  double longest_ = HUGE_VAL;               ///< of steps by local error, without sign
  std::optional<RateMeter> meter_;
  std::optional<Integrator> whole_;  ///< the whole steps beside halves of them
  Work local_work_;                  ///< of these and of the main sequence
  std::vector<double> instants_;     ///< that steps by their local error end at
  std::size_t instant_ = 0;          ///< the next one
  double sign_;
  Rate rate_;  ///< at the current node
  Vector v_;   ///< there
  bool kinks_beside_ = false;
  double z_ = 0.0;
  double eps_ = 0.0;  ///< of this part of the motion: adaptive_.eps, or less behind a kink
  double next_size_ = 0.0;
  struct Sizes {
    double newest, older;
  };
  std::vector<Sizes> last_sizes_;  ///< of each part
};

}  // namespace diracstep
