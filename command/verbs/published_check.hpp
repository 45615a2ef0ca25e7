#pragma once

#include <diracstep/command/session.hpp>

namespace diracstep::command {

/// Runs every scene of the catalogue as its file recommends and prints its end beside the values that the
/// file cites; the exit status tells whether all agree.
void check_published_cases(bool json, Session& session);

}  // namespace diracstep::command
