#pragma once

#include <filesystem>
#include <string>

namespace diracstep {

/// Why a file cannot be a whole shared object, or empty: on ELF systems every segment that is to be loaded
/// must lie within the file.  The system's loader maps a file that was cut off and dies of it.  Damage within
/// a file of full length is not seen: loading an object means trusting it.
std::string damage_of(const std::filesystem::path& file);

}  // namespace diracstep
