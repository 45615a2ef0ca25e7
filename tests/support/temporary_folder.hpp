#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace diracstep::testing {

/// A whole file as it is.
inline std::string contents(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return (std::ostringstream() << file.rdbuf()).str();
}

/// An empty folder that nobody else has, removed with all in it at the end.
class TemporaryFolder {
 public:
  TemporaryFolder() : path_(free_path()) {
    std::filesystem::remove_all(path_);  // of an earlier process of the same number
    std::filesystem::create_directories(path_);
    std::filesystem::permissions(path_, std::filesystem::perms::owner_all);
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::string path(const std::string& name) const { return (path_ / name).string(); }

  /// Writes a file, and gives its path.
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }

 private:
  static std::filesystem::path free_path() {
    static int count = 0;
    return std::filesystem::temp_directory_path() /
           ("diracstep_test_" + std::to_string(getpid()) + "_" + std::to_string(count++));
  }

  std::filesystem::path path_;
};

}  // namespace diracstep::testing
