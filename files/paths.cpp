#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/paths.hpp>
#include <filesystem>

namespace diracstep {

namespace {

namespace fs = std::filesystem;

std::string folder_of(const std::string& path) {
  const std::string folder = fs::path(path).parent_path().string();
  return folder.empty() ? "." : folder;
}

bool same_inode(const std::string& a, const std::string& b) {
  struct stat first {
  }, second{};
  return ::stat(a.c_str(), &first) == 0 && ::stat(b.c_str(), &second) == 0 && first.st_dev == second.st_dev &&
         first.st_ino == second.st_ino;
}

void require_writable(const NamedPath& output) {
  const auto refuse = [&](int error) {
    throw Misuse(
        fmt::format("{}: '{}' cannot be written: {}", output.what, output.path, std::strerror(error)));
  };
  const std::string path = behind_links(output.path);
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0) {
    if (S_ISDIR(status.st_mode)) refuse(EISDIR);
    if (::access(path.c_str(), W_OK) != 0) refuse(errno);
    return;
  }
  if (errno != ENOENT || ::access(folder_of(path).c_str(), W_OK | X_OK) != 0) refuse(errno);
}

}  // namespace

std::string behind_links(std::string path) {
  std::error_code none;
  for (int links = 0; links < 40 && fs::is_symlink(path, none); ++links) {
    const fs::path target = fs::read_symlink(path, none);
    path = target.is_absolute() ? target.string() : (fs::path(folder_of(path)) / target).string();
  }
  return path;
}

bool same_file(const std::string& a, const std::string& b) {
  std::error_code none;
  const fs::file_status status = fs::status(a, none);
  if (fs::exists(status) && !fs::is_regular_file(status)) return false;
  if (same_inode(a, b)) return true;
  const std::string first = behind_links(a), second = behind_links(b);
  return fs::path(first).filename() == fs::path(second).filename() &&
         same_inode(folder_of(first), folder_of(second));
}

void require_outputs(const std::vector<NamedPath>& outputs, const std::vector<NamedPath>& inputs) {
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const auto require_other = [&](const NamedPath& other) {
      if (same_file(outputs[i].path, other.path))
        throw Misuse(
            fmt::format("{} and {} are both '{}'{}", outputs[i].what, other.what, other.path,
                        outputs[i].path == other.path ? "" : fmt::format(" ('{}')", outputs[i].path)));
    };
    for (const NamedPath& input : inputs) require_other(input);
    for (std::size_t j = 0; j < i; ++j) require_other(outputs[j]);
  }
  for (const NamedPath& output : outputs) require_writable(output);
}

}  // namespace diracstep
