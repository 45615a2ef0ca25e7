#pragma once

#include <diracstep/command/arguments.hpp>
#include <diracstep/command/files/checkpoint_file.hpp>
#include <diracstep/command/files/trajectory_file.hpp>
#include <diracstep/command/run_report.hpp>
#include <diracstep/command/session.hpp>
#include <diracstep/command/verbs/run_arguments.hpp>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <optional>
#include <vector>

namespace diracstep::command {

/// Opens the file of --out, if there is one; it goes on from the checkpoint, or begins.
void open_trajectory(std::optional<TrajectoryFile>& file, const RunArguments& options,
                     const CatalogueScene& entry, const std::optional<Checkpoint>& saved,
                     const std::vector<Output>& sensitivities = {});

/// Closes the file, and tells and notes how many points it holds.
void finish_trajectory(std::optional<TrajectoryFile>& file, const RunArguments& options, RunResult& result);

/// One run with the chosen steps to `end`, into `result`: steps of one size or of varying size, through the
/// events of the scene, with its points, checkpoints and sensitivities.  Returns the options that were used.
/// Throws Misuse for arguments that do not fit the scene; what fails on the way stands in `result`.
IntegratorOptions run_once(const RunArguments& options, const CatalogueScene& entry, const Session& session,
                           IntegratorOptions chosen, double end, RunResult& result);

}  // namespace diracstep::command
