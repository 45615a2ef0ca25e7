#pragma once

#include <diracstep/command/verbs/run_arguments.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <vector>

namespace diracstep::command {

/// The times of --at, or those of --every-time from the start to the end; none where there are neither.
std::vector<double> chosen_times(const RunArguments& options, const CatalogueScene& entry, double end);

/// Throws Misuse for times out of order or outside the run from `start` to `end`, whose steps are about so
/// long.
void require_within(const std::vector<double>& times, double start, double end, double step);

}  // namespace diracstep::command
