#pragma once

#include <string>
#include <utility>
#include <vector>

namespace diracstep {

/// The value of a fact that cannot be found out.
inline constexpr const char* unknown_fact = "unknown";

/// What run times depend on: name and value of the library's version, the SUNDIALS that is linked, the
/// compiler, the processor and the operating system.
std::vector<std::pair<std::string, std::string>> build_facts();

}  // namespace diracstep
