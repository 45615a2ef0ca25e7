#pragma once

#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/methods/default_method.hpp>
#include <memory>
#include <optional>
#include <string>

namespace diracstep {

/// How fast a motion is damped, beside the steps that it is followed with.
struct DampingSurvey {
  double rate = 0.0;      ///< d, the largest decay rate met, 1/time
  double undamped = 0.0;  ///< the largest |Im λ| with |Re λ| below a hundredth of it, where that is smallest
  double step = 0.0;      ///< h, the step where d h is largest
  double product = 0.0;   ///< the largest d h
  double covered = 0.0;   ///< time surveyed
  /// How many of the steps by their local error that a larger one was refused for fit into one of the fixed
  /// steps it is compared with; 1 where none was, or no fixed step is given.
  double finer = 1.0;
  /// Where a force that is not linear in v determines velocities (FirstOrderMotions::by_force), the largest
  /// ratio of the sizes that an entry of ∂f/∂v has at two nodes.
  double resistance_ratio = 1.0;
  std::string failure = {};  ///< empty, or why nothing is known

  /// Above it GL(s) leaves a third and more of what should have died out, with a sign that alternates from
  /// step to step.
  static constexpr double strong_from = 20.0;
  bool strong() const { return failure.empty() && product > strong_from; }
  /// What is fastest dies out within a fixed step, and that is too long for the motion, or so much too long
  /// that the survey ends within it, as where a diode begins to conduct: GL(s) loses Newton's method there.
  static constexpr double switching_from = 3.0, finer_from = 3.0;
  static constexpr double begins_from = 0.1, far_finer_from = 100.0;
  bool switching() const {
    return failure.empty() && ((product > switching_from && finer > finer_from) ||
                               (product > begins_from && finer > far_finer_from && covered < step));
  }
  /// Velocities that nothing stores are found by forces that switch, as those of diodes without capacitance:
  /// GL(s) loses Newton's method where they do, with any step.
  static constexpr double switched_from = 1e3;
  bool switched() const { return failure.empty() && resistance_ratio > switched_from; }
};

/// Measures the damping along the motion to `end`: at the nodes of a coarse run of damped/radau:3, at most
/// 150 steps by their local error, d is the largest −Re λ of the eigenvalues λ of the motion linearised about
/// the node, on the tangent space of its rows and rates,
///
///   δq̇ = δv,   δv̇ = ∂a/∂q δq + ∂a/∂v δv,
///
/// by differences of the acceleration a to both sides: a diode conducts on one.  Where nothing has mass and
/// rows, hidden ones among them, make the velocity a function v(t, q), it is that of δq̇ = ∂v/∂q δq, for more
/// than 60 coordinates the eigenvalue of largest size, by power iterations.  It is compared with `step`,
/// without sign, which a run with fixed steps takes there, or, where that is 0, with the step of the coarse
/// run, at most a fiftieth of the motion.  Points before anything has moved have no sizes to difference by
/// and are left out.
///
/// Nothing is measured for a phase-space Lagrangian, and, where there is mass, without a force and without
/// states (has_states()), since nothing else damps there, and for more than 60 coordinates.  Throws Misuse as
/// AdaptiveIntegrator does.
DampingSurvey survey_damping(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                             const SolverFactory& solvers, double end, double step,
                             const IntegratorOptions& options = {});

/// The method for a motion to `end` where none is named: damped/radau:3 where no order, no rule and no error
/// below 1e-9 is asked for and survey_damping() finds strong damping, or damping where fixed steps are too
/// long for the motion; else that of default_method().
///
/// Radau IIA also takes energy from what nothing damps.  Where the survey finds such a motion, of ω T radians
/// in all, DefaultMethod::local_error is eps = (2e-3/(ω T))^(6/5), from 1e-8 to 1e-6: on an oscillator the
/// amplitude lost is about 4.5e-3 ω T eps^(5/6) (measured for ω T from 1e2 to 1e5), then 1e-5.
DefaultMethod default_method_of_motion(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                                       const SolverFactory& solvers, double end, double step,
                                       const IntegratorOptions& options, const MethodRequest& request);

}  // namespace diracstep
