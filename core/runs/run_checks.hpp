#pragma once

#include <diracstep/core/runs/branch_check.hpp>
#include <diracstep/core/runs/energy_check.hpp>
#include <diracstep/core/runs/step_size_check.hpp>

namespace diracstep {

/// All that tells when a run of fixed steps is not to be believed although every step was solved. run_steps()
/// takes one along; a loop of one's own calls it around each step and shows it points on the way, the start
/// first.
class RunChecks {
 public:
  /// For the next so many steps.  The integrator's scene must outlive this.
  RunChecks(const Integrator& integrator, long steps)
      : energy_(integrator.scene()), step_(integrator, steps), branch_(integrator) {}

  void before_step(Integrator& integrator) { step_.before(integrator); }
  void after_step(const Integrator& integrator) {
    step_.after(integrator);
    branch_.after(integrator);
  }
  void see(const Sample& point) { energy_.see(point); }

  /// Empty, or the doubts, one after the other.
  std::string text() const {
    std::string all;
    for (const std::string& text : {energy_.text(), step_.text(), branch_.text()})
      if (!text.empty()) all += (all.empty() ? "" : "; ") + text;
    return all;
  }

 private:
  EnergyCheck energy_;
  StepSizeCheck step_;
  BranchCheck branch_;
};

/// The steps of an integrator, with the checks around each where there are any.
struct CheckedSteps {
  Integrator& integrator;
  RunChecks* checks;

  StepReport step() const {
    if (checks != nullptr) checks->before_step(integrator);
    StepReport report = integrator.step();
    if (checks != nullptr && report.ok()) checks->after_step(integrator);
    return report;
  }
};

}  // namespace diracstep
