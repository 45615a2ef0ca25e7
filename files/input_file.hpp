#pragma once

#include <cstddef>
#include <string>

namespace diracstep {

/// All of the regular file at `path`.  Throws Misuse, naming `what`, the path and the reason, for a file that
/// cannot be read, that is no regular file (a device or a pipe need not end) or that holds more than `limit`
/// bytes; nothing is read of these.
std::string read_file(const std::string& path, const std::string& what, std::size_t limit);

}  // namespace diracstep
