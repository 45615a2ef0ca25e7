#pragma once

#include <filesystem>
#include <string>

namespace diracstep::command {

/// Replaces a file, whole or not at all; what went wrong, or empty.
std::string write_file(const std::filesystem::path& path, const std::string& text);

/// Makes a directory that is to receive output.  Throws Misuse where it cannot be made.
std::filesystem::path output_directory(const std::string& path);

}  // namespace diracstep::command
