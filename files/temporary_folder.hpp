#pragma once

#include <cstdlib>
#include <diracstep/core/numerics/errors.hpp>
#include <filesystem>
#include <string>
#include <system_error>

namespace diracstep {

/// A folder of this process, in that of the system for temporary files, with what is in it until the end.
class TemporaryFolder {
 public:
  /// Throws Error, naming it, where it cannot be made.
  explicit TemporaryFolder(const std::string& purpose) {
    std::error_code none;
    const std::filesystem::path place = std::filesystem::temp_directory_path(none);
    std::string name = (place / ("diracstep-" + purpose + "-XXXXXX")).string();
    if (place.empty() || mkdtemp(name.data()) == nullptr)
      throw Error("no temporary directory can be made: " + name);
    path_ = name;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

}  // namespace diracstep
