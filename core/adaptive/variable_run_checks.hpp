#pragma once

#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/runs/energy_check.hpp>
#include <diracstep/core/runs/kink_check.hpp>
#include <diracstep/core/runs/node_check.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <diracstep/core/runs/step_comparison.hpp>
#include <diracstep/core/runs/work_check.hpp>

namespace diracstep {

/// What RunChecks does, for variable steps: the energy at the points shown, and at the nodes that are asked
/// for steps beside two parts of them, alternating values and frozen momenta.  Steps are divided by the side
/// integrator of one's own, so that the main sequence keeps its bits.
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
        jumps_(integrator.integrator()) {}

  void before_step();
  void after_step();
  void see(const Sample& point) {
    energy_.see(point);
    if (!integrator_.kinks_beside()) work_.see(point);  // no cubic follows the forces across them
  }

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
  JumpCheck jumps_;
  long next_look_ = 1;
  bool looking_ = false;
  Sample node_, start_, whole_, parts_;
};

}  // namespace diracstep
