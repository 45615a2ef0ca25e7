#pragma once

#include <diracstep/command/verbs/run_arguments.hpp>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <vector>

namespace diracstep::command {

/// The times of --at, or those of --every-time from the start to the end; none where there are neither.
std::vector<double> chosen_times(const RunArguments& options, const CatalogueScene& entry, double end);

/// Throws Misuse for times out of order or outside the run.
void require_within(const std::vector<double>& times, const Integrator& integrator, long steps);

}  // namespace diracstep::command
