#pragma once

#include <diracstep/core/system/scene.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// Whether rows whose one-forms depend on those of others demand something else than these.  With
/// A_d = C A_o, rows A v + b = 0 agree where  b_d = C b_o,  and holonomic ones where a pose of the others
/// meets them.  Looked at, for up to 100 rows, at the start and at poses around it that the others allow, at
/// its time and at times from 1e-6 to 1e6 from it in steps of half a decade; rows that part for a short
/// while between these are not seen.
///
/// Empty, or a line that names such a row and those that it contradicts.
std::string contradiction(const Scene& scene, const Start& start, const std::vector<std::string>& dependent);

/// Names of the other rows whose combination the one-form of a row is nearest to at the start; `dependent` is
/// not among them.
std::vector<std::string> combined_rows(const Scene& scene, const Start& start, const std::string& row,
                                       const std::vector<std::string>& dependent);

}  // namespace diracstep
