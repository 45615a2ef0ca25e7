#pragma once

#include <diracstep/boundary_values/boundary_values.hpp>
#include <string>

namespace diracstep::command {

/// Through the points of a CSV file with columns t, coordinates and v_NAME.  Throws Misuse where one is
/// missing.
GuessedMotion guess_from_file(const std::string& path, const Scene& scene);

}  // namespace diracstep::command
