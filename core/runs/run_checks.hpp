#pragma once

#include <diracstep/core/runs/branch_check.hpp>
#include <diracstep/core/runs/energy_check.hpp>
#include <diracstep/core/runs/growth_check.hpp>
#include <diracstep/core/runs/impulse_check.hpp>
#include <diracstep/core/runs/jump_check.hpp>
#include <diracstep/core/runs/kink_check.hpp>
#include <diracstep/core/runs/node_check.hpp>
#include <diracstep/core/runs/step_size_check.hpp>
#include <diracstep/core/runs/work_check.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// The lines that are not empty, one after the other.
inline std::string joined_doubts(const std::vector<std::string>& lines) {
  std::string all;
  for (const std::string& text : lines)
    if (!text.empty()) all += (all.empty() ? "" : "; ") + text;
  return all;
}

/// All that tells when a run of fixed steps is not to be believed although every step was solved. run_steps()
/// takes one along; a loop of one's own calls it around each step and shows it points on the way, the start
/// first.
class RunChecks {
 public:
  /// For the next so many steps.  The integrator's scene must outlive this.
  RunChecks(const Integrator& integrator, long steps)
      : scene_(integrator.scene()),
        energy_(integrator.scene(), integrator.method().damped),
        step_(integrator, steps, true),
        nodes_(integrator.scene(), steps),
        branch_(integrator),
        growth_(integrator, steps),
        work_(integrator),
        impulse_(integrator),
        jumps_(integrator),
        kinks_(integrator, integrator.time() + static_cast<double>(steps) * integrator.options().step) {}

  void before_step(Integrator& integrator) {
    if (step_number_ == 0) growth_.at_node(integrator);
    if (nodes_.wants(step_number_)) see_node(integrator);
    step_.before(integrator);
  }
  void after_step(Integrator& integrator) {
    ++step_number_;
    branch_.after(integrator);
    kinks_.after(integrator);
    jumps_.after(integrator.kinks_passed(), integrator, integrator);
    work_.after(integrator);
    impulse_.after(integrator);
    step_.after(integrator);
    growth_.at_node(integrator);
  }
  void see(const Sample& point) {
    energy_.see(point);
    growth_.see(point);
    step_.see(point);
    work_.see(point);
  }
  /// Where the run has come to its end.
  void finish(Integrator& integrator) {
    step_.finish(integrator, !kinks_.text().empty());
    growth_.finish(integrator, step_.part_of_motion());
  }

  /// Empty, or the doubts, one after the other.  Work done between the nodes of steps that cross kinks is not
  /// known well: it tells nothing of a run that was confirmed.
  std::string text() const {
    return joined_doubts({energy_.text(), step_.confirmed() ? std::string() : work_.text(), step_.text(),
                          nodes_.text(), branch_.text(), growth_.text(), impulse_.text(), jumps_.text(),
                          kinks_.text(step_.confirmed()), scene_.doubt ? scene_.doubt() : std::string()});
  }

 private:
  void see_node(Integrator& integrator) {
    if (integrator.sample(Momentum::projected, node_).ok()) nodes_.see(step_number_, node_);
  }

  const Scene& scene_;
  EnergyCheck energy_;
  StepSizeCheck step_;
  NodeCheck nodes_;
  BranchCheck branch_;
  GrowthCheck growth_;
  WorkCheck work_;
  ImpulseCheck impulse_;
  JumpCheck jumps_;
  KinkCheck kinks_;
  long step_number_ = 0;
  Sample node_;
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
