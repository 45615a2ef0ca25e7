#pragma once

#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/runs/energy_check.hpp>
#include <diracstep/core/runs/impulse_check.hpp>
#include <diracstep/core/runs/kink_check.hpp>
#include <diracstep/core/runs/node_check.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <diracstep/core/runs/step_comparison.hpp>
#include <diracstep/core/runs/work_check.hpp>
#include <limits>
#include <string>

namespace diracstep {

/// What RunChecks does, for variable steps: the energy at the points shown, and at the nodes that are asked
/// for, or where the velocity changed fast, steps beside two parts of them, alternating values and frozen
/// momenta.  Steps are divided by the side
/// integrator of one's own, so that the main sequence keeps its bits.  A run of at most 20000 steps and 12
/// coordinates and rows in which the controller lost the rate is repeated.
class VariableRunChecks {
 public:
  /// The integrator must outlive this.
  VariableRunChecks(AdaptiveIntegrator& integrator, Integrator side)
      : integrator_(integrator),
        side_(std::move(side)),
        energy_(integrator.integrator().scene(), integrator.integrator().method().damped),
        nodes_(integrator.integrator().scene(), 0, !integrator.integrator().method().damped),
        comparison_(integrator.integrator().scene(), integrator.integrator().method().order,
                    !integrator.integrator().method().damped),
        kinks_(integrator.integrator(),
               integrator.adaptive().end.value_or(integrator.time() +
                                                  100.0 * integrator.integrator().options().step)),
        work_(integrator.integrator()),
        impulse_(integrator.integrator()),
        velocity_(integrator.integrator().velocity_estimate()),
        jumps_(integrator.integrator()),
        resets_before_(integrator.control().resets) {}

  void before_step();
  void after_step();
  void see(const Sample& point) {
    if (first_.q.size() == 0) first_ = point;
    energy_.see(point);
    impulse_.see(point);
    if (!integrator_.kinks_beside()) work_.see(point);  // no cubic follows the forces across them
  }

  /// Behind the last step: where the controller of reversible steps began anew more often than once in 1000
  /// steps, it lost the rate of the motion, and the run is repeated with finer ones, as StepSizeCheck does.
  void finish();

  /// Empty, or the doubts, one after the other.
  std::string text() const;

 private:
  bool at_kink() const;
  bool divide(double size);

  AdaptiveIntegrator& integrator_;
  Integrator side_;
  EnergyCheck energy_;
  NodeCheck nodes_;
  StepComparison comparison_;
  KinkCheck kinks_;
  WorkCheck work_;
  ImpulseCheck impulse_;
  VelocityChanges velocity_;
  JumpCheck jumps_;
  long next_look_ = 1;
  bool looking_ = false;
  Sample first_;
  long taken_ = 0, resets_before_;
  double way_ = 0.0, largest_momentum_ = 0.0;
  double error_ = std::numeric_limits<double>::quiet_NaN();  ///< by the run of finer steps
  Sample node_, start_, whole_, parts_;
};

}  // namespace diracstep
