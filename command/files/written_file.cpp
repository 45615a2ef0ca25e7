#include <fmt/format.h>

#include <diracstep/command/files/written_file.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/output_file.hpp>
#include <exception>

namespace diracstep::command {

std::string write_file(const std::filesystem::path& path, const std::string& text) {
  try {
    replace_file(path.string(), text);
  } catch (const std::exception& error) {
    return error.what();
  }
  return {};
}

std::filesystem::path output_directory(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw Misuse(fmt::format("--out: '{}' cannot be made: {}", path, error.message()));
  return path;
}

}  // namespace diracstep::command
