#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/files/sha256.hpp>
#include <diracstep/scene_format/loader/kernel_cache.hpp>
#include <vector>

namespace diracstep {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view seal = "\ndiracstep kernels, SHA-256 ";  ///< at the end, before the digits
constexpr std::size_t digits = 64;
constexpr std::size_t largest_object = 500'000'000;  // bytes

fs::path cache_folder() {
  if (const std::string own = environment("DIRACSTEP_CACHE"); !own.empty()) return own;
  if (const std::string cache = environment("XDG_CACHE_HOME"); !cache.empty())
    return fs::path(cache) / "diracstep";
  if (const std::string home = environment("HOME"); !home.empty())
    return fs::path(home) / ".cache" / "diracstep";
  return {};
}

bool others_write(const struct stat& status) { return (status.st_mode & (S_IWGRP | S_IWOTH)) != 0; }

/// Empty, or why another user could put something else in the place of the folder or what is in it.
std::string distrust(const fs::path& folder) {
  std::error_code error;
  const fs::path whole = fs::canonical(folder, error);
  if (error) return fmt::format("{}: {}", folder.string(), error.message());
  struct stat status {};
  for (fs::path at = whole;; at = at.parent_path()) {
    if (::stat(at.c_str(), &status) != 0) return fmt::format("{} cannot be examined", at.string());
    const bool own = status.st_uid == geteuid(), innermost = at == whole;
    if (!own && (innermost || status.st_uid != 0))
      return fmt::format("{} belongs to another user", at.string());
    const bool sticky = !innermost && (status.st_mode & S_ISVTX) != 0;  // there only owners rename and remove
    if (others_write(status) && !sticky) return fmt::format("others may write to {}", at.string());
    if (at == at.parent_path()) return "";
  }
}

std::string distrust_file(const fs::path& path) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return "is no regular file";
  if (status.st_uid != geteuid()) return "belongs to another user";
  return others_write(status) ? "may be written by others" : "";
}

bool is_sealed(std::string_view bytes) {
  if (bytes.size() < seal.size() + digits) return false;
  const std::string_view object = bytes.substr(0, bytes.size() - seal.size() - digits);
  return bytes.substr(object.size(), seal.size()) == seal &&
         bytes.substr(object.size() + seal.size()) == sha256(object);
}

/// What is kept here: objects, also those of version 0.1.0, and folders that a killed process left.
bool is_ours(const fs::path& path) {
  const std::string name = path.stem().string();
  return path.extension() == ".so" && name.size() >= 32 &&
         name.find_first_not_of("0123456789abcdef") == std::string::npos;
}

}  // namespace

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

KernelCache::KernelCache() : folder_(cache_folder()) {
  if (folder_.empty()) {
    refusal_ = "no cache: set DIRACSTEP_CACHE, XDG_CACHE_HOME or HOME";
    return;
  }
  std::error_code error;
  if (!fs::exists(folder_, error)) {
    fs::create_directories(folder_.parent_path(), error);
    ::mkdir(folder_.c_str(), 0700);
  }
  refusal_ = distrust(folder_);
}

std::shared_ptr<void> loaded_object(const fs::path& path) {
  const auto close = [](void* handle) {
    if (handle != nullptr) dlclose(handle);
  };
  return {dlopen(fs::absolute(path).c_str(), RTLD_NOW | RTLD_LOCAL), close};
}

std::shared_ptr<void> KernelCache::load(const std::string& key, std::string& complaint) const {
  std::error_code error;
  if (!refusal_.empty() || !fs::exists(fs::symlink_status(file(key), error))) return nullptr;
  complaint = distrust_file(file(key));
  if (complaint.empty()) {
    try {
      if (!is_sealed(read_file(file(key).string(), "the kernels", largest_object))) complaint = "is damaged";
    } catch (const Misuse&) {
      complaint = "cannot be read";
    }
  }
  if (!complaint.empty()) return nullptr;
  std::shared_ptr<void> object = loaded_object(file(key));
  if (!object) complaint = "cannot be loaded";
  ::utimensat(AT_FDCWD, file(key).c_str(), nullptr, 0);  // the one used last is removed last
  return object;
}

fs::path KernelCache::make_work_folder() const {
  std::error_code error;
  std::vector<fs::path> places;
  if (refusal_.empty()) places.push_back(folder_);
  places.push_back(fs::temp_directory_path(error));
  for (const fs::path& place : places) {
    std::string name = (place / ".work-XXXXXX").string();
    if (!place.empty() && ::mkdtemp(name.data()) != nullptr) return name;
  }
  return {};
}

bool KernelCache::keep(const fs::path& object, const std::string& key) const {
  if (!refusal_.empty()) return false;
  try {
    const std::string bytes = read_file(object.string(), "the object", largest_object);
    const fs::path sealed = object.parent_path() / "sealed.so";
    replace_file(sealed.string(), bytes + std::string(seal) + sha256(bytes));
    ::chmod(sealed.c_str(), 0600);
    if (std::rename(sealed.c_str(), file(key).c_str()) != 0) return false;
    sync_folder(folder_.string());
  } catch (const std::exception&) {  // a full disk, a folder that may only be read
    return false;
  }
  limit_size(file(key));
  return true;
}

void KernelCache::limit_size(const fs::path& newest) const {
  struct Kept {
    fs::path path;
    fs::file_time_type used;
    std::uintmax_t bytes;
  };
  std::uintmax_t limit = usual_bytes, total = 0;
  if (const std::string given = environment("DIRACSTEP_CACHE_BYTES"); !given.empty())
    limit = std::strtoull(given.c_str(), nullptr, 10);
  std::error_code error;
  std::vector<Kept> all;
  for (const auto& entry : fs::directory_iterator(folder_, error)) {
    const bool old = fs::file_time_type::clock::now() - entry.last_write_time(error) > std::chrono::hours(24);
    if (entry.is_directory(error) && old && entry.path().filename().string().starts_with(".work-"))
      fs::remove_all(entry.path(), error);  // a process was killed while it compiled
    if (!entry.is_regular_file(error) || !is_ours(entry.path())) continue;
    all.push_back({entry.path(), entry.last_write_time(error), entry.file_size(error)});
    total += all.back().bytes;
  }
  std::ranges::sort(all, {}, &Kept::used);
  for (const Kept& kept : all) {
    if (total <= limit) return;
    if (kept.path == newest || !fs::remove(kept.path, error)) continue;
    total -= kept.bytes;
  }
}

}  // namespace diracstep
