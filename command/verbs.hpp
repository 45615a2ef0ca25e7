#pragma once

#include <CLI/App.hpp>
#include <diracstep/command/session.hpp>

namespace diracstep::command {

/// Each adds one verb with its options; the verb runs while the command line is parsed and leaves its exit
/// status in the session, which must outlive the parser.
void add_boundary(CLI::App& app, Session& session);
void add_check(CLI::App& app, Session& session);
void add_control(CLI::App& app, Session& session);
void add_equilibrium(CLI::App& app, Session& session);
void add_expand(CLI::App& app, Session& session);
void add_fit(CLI::App& app, Session& session);
void add_list(CLI::App& app, Session& session);
void add_new(CLI::App& app, Session& session);
void add_orders(CLI::App& app, Session& session);
void add_parts(CLI::App& app, Session& session);
void add_plan(CLI::App& app, Session& session);
void add_run(CLI::App& app, Session& session);
void add_stability(CLI::App& app, Session& session);
void add_start(CLI::App& app, Session& session);
void add_study(CLI::App& app, Session& session);
void add_sweep(CLI::App& app, Session& session);

}  // namespace diracstep::command
