#pragma once

#include <diracstep/command/files/checkpoint_file.hpp>
#include <diracstep/command/files/trajectory_file.hpp>
#include <diracstep/command/run_report.hpp>
#include <diracstep/command/run_sensitivities.hpp>
#include <diracstep/core/runs/event_steps.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace diracstep::command {

/// What a run keeps on its way.
struct Keeping {
  Momentum momentum = Momentum::projected;
  long every = 1;  ///< each so many points go to the file
  /// In place of each so many: times in the direction of the steps, which may lie between nodes.
  std::vector<double> times = {};
  TrajectoryFile* file = nullptr;                                  ///< none: only the end is read
  RunSensitivities* sensitivities = nullptr;                       ///< that follow each step, if any
  std::string checkpoint = {};                                     ///< path, or empty
  long checkpoint_every = 0;                                       ///< steps; 0: every ten seconds
  std::vector<std::pair<std::string, std::string>> identity = {};  ///< of the run, for the checkpoint
};

/// Steps from where they stand to step number `steps`, to an event that stops them, to a failure or to
/// Ctrl-C, and keeps points and checkpoints on the way.  A checkpoint stands before the point of its step is
/// kept, and what it says of the trajectory is on the disk before it is.
void run_to(long steps, EventSteps<Integrator>& motion, const Keeping& keeping, RunResult& result);

}  // namespace diracstep::command
