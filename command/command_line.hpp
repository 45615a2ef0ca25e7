#pragma once

namespace diracstep::command {

/// Reads a command line, runs its verb, and returns the exit status; what is wrong is told on standard error.
/// Without `run_verbs` the line is read, its plugins are loaded, and no verb runs.
int execute(int count, char** arguments, bool run_verbs = true);

}  // namespace diracstep::command
