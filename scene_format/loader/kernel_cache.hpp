#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

namespace diracstep {

/// The value of an environment variable; empty where it is not set.
std::string environment(const char* name);

/// A folder of shared objects that this user has compiled.  What is loaded from it runs in this process, so a
/// file counts only where it and its folder belong to this user and nobody else may write them, no folder
/// above lets another user rename them, and the SHA-256 at its end is that of its bytes.
class KernelCache {
 public:
  /// $DIRACSTEP_CACHE, else $XDG_CACHE_HOME/diracstep, else ~/.cache/diracstep; made, with access for this
  /// user alone, where it is not there.
  KernelCache();

  /// Empty, or why nothing is kept or taken.
  const std::string& refusal() const { return refusal_; }

  /// The object of that key, loaded; null where there is none or it may not be used.  `complaint` is set
  /// where there is one that may not be.
  std::shared_ptr<void> load(const std::string& key, std::string& complaint) const;

  /// A folder for the files of one compilation, in the cache where that may be used, else in the system's
  /// folder for temporary files; for this user alone.  Empty where none can be made.
  std::filesystem::path make_work_folder() const;

  /// Keeps a compiled object, whole or not at all, and removes those used longest ago while all together are
  /// larger than $DIRACSTEP_CACHE_BYTES, or 256 MB.  False where it cannot be kept.
  bool keep(const std::filesystem::path& object, const std::string& key) const;

  static constexpr std::uintmax_t usual_bytes = 256'000'000;

 private:
  std::filesystem::path file(const std::string& key) const { return folder_ / (key + ".so"); }
  void limit_size(const std::filesystem::path& newest) const;

  std::filesystem::path folder_;
  std::string refusal_;
};

/// Loads a shared object; null where that fails.
std::shared_ptr<void> loaded_object(const std::filesystem::path& path);

}  // namespace diracstep
