#pragma once

#include <diracstep/core/registry.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <string>
#include <string_view>

namespace CLI {
class App;
}

namespace diracstep::command {

/// Exit statuses of the command.
inline constexpr int done = 0;
inline constexpr int failed = 1;  ///< a numerical failure, an interrupt, or output that could not be written
inline constexpr int misused = 2;

/// What the verbs share.
struct Session {
  Registry registry = Registry::with_built_ins();
  KinsolOptions solver_options = {};
  SolverFactory solvers = kinsol();
  int exit_status = done;
};

/// Adds --solver and --jacobian, which change the session's solvers when the command line is read.
void add_solver_options(CLI::App& verb, Session& session);

/// A message for a person, on standard error.
void say(std::string_view message);

/// Text for standard output, and the end of it.  Both throw std::runtime_error where it cannot be written.
void print(std::string_view text);
void finish_output();

}  // namespace diracstep::command
