#pragma once

#include <diracstep/core/adaptive/error_control.hpp>
#include <functional>
#include <memory>

namespace diracstep::detail {

/// Reads the state at a node of a run.
struct ReadNode {
  const Scene& scene;  ///< the one that is stepped, with its hidden rows and without those left out
  std::function<SolveReport(Momentum, Sample&)> sample;

  SolveReport operator()(Momentum momentum, Sample& to) const { return sample(momentum, to); }
};
/// Called at the start, at each node and at the end; false ends the run.
using AtNode = std::function<bool(const ReadNode& read, bool last)>;

struct StepsTaken {
  StepReport last;
  /// Whether the last step was refused because the motion crosses a kink again and again.
  bool sticks = false;
};

/// One run with the steps of a report.  `work` is what it has taken so far, at each node and at the end.
StepsTaken run_steps_of(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                        const SolverFactory& solvers, const ErrorControlReport::Steps& steps, bool adaptive,
                        double end, Work& work, const AtNode& at_node);

}  // namespace diracstep::detail
