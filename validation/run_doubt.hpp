#pragma once

#include <diracstep/validation/branch_doubt.hpp>
#include <diracstep/validation/energy_doubt.hpp>
#include <diracstep/validation/step_doubt.hpp>

namespace diracstep {

/// All that tells when a run of fixed steps is not to be believed although every step was solved.
class RunDoubt {
 public:
  /// For a run to step number `steps`.  The integrator's scene must outlive this.
  RunDoubt(const Integrator& integrator, long steps)
      : energy_(integrator.scene()), step_(steps), branch_(integrator) {}

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
  EnergyDoubt energy_;
  StepDoubt step_;
  BranchDoubt branch_;
};

}  // namespace diracstep
