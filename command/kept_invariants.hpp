#pragma once

#include <diracstep/command/run_report.hpp>
#include <optional>

namespace diracstep::command {

/// What the scene declares as kept, at both ends of a run.  A doubt where an invariant is not as `stated`
/// values of the scene say, which hold for its own parameters, and where it changed by more than an `error`
/// that a search found would allow.
void compare_invariants(const CatalogueScene& entry, bool stated, std::optional<double> error,
                        RunResult& result);

}  // namespace diracstep::command
