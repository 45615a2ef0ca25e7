#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <diracstep/core/errors.hpp>
#include <diracstep/validation/command/output_file.hpp>

namespace diracstep::command {

std::string write_file(const std::filesystem::path& path, const std::string& text) {
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (file == nullptr) return fmt::format("'{}' cannot be written: {}", path.string(), std::strerror(errno));
  const bool written =
      std::fwrite(text.data(), 1, text.size(), file) == text.size() && std::fflush(file) == 0;
  const int error = errno;
  if (std::fclose(file) == 0 && written) return {};
  return fmt::format("'{}' could not be written in full: {}", path.string(),
                     std::strerror(written ? errno : error));
}

std::filesystem::path output_directory(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw Misuse(fmt::format("--out: '{}' cannot be made: {}", path, error.message()));
  return path;
}

}  // namespace diracstep::command
