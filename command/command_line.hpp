#pragma once

#include <diracstep/command/processes.hpp>

namespace diracstep::command {

/// Reads a command line, runs its verb, and returns the exit status; what is wrong is told on standard error.
/// Without `run_verbs` the line is read, its plugins are loaded, and no verb runs.  `processes` are those
/// that a verb may share its work with.
int execute(int count, char** arguments, bool run_verbs = true, const Processes& processes = {});

}  // namespace diracstep::command
