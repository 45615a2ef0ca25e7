#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/file_lock.hpp>
#include <diracstep/files/paths.hpp>
#include <filesystem>

namespace diracstep {

namespace {

/// Whether the open file is still the one of that name: whoever had the lock may have removed it.
bool is_at(int descriptor, const std::string& name) {
  struct stat open {
  }, named{};
  return ::fstat(descriptor, &open) == 0 && ::lstat(name.c_str(), &named) == 0 &&
         open.st_ino == named.st_ino && open.st_dev == named.st_dev;
}

}  // namespace

bool take_lock(int descriptor) {
  while (::flock(descriptor, LOCK_EX | LOCK_NB) != 0)
    if (errno != EINTR) return errno != EWOULDBLOCK;
  return true;
}

FileLock::FileLock(const std::string& path) : name_(behind_links(path) + ".lock") {
  std::error_code none;
  const auto status = std::filesystem::status(path, none);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) return;
  for (;;) {
    descriptor_ =
        ::open(name_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600);  // NOLINT
    if (descriptor_ < 0)
      throw Misuse(fmt::format("'{}' cannot be locked: '{}': {}", path, name_, std::strerror(errno)));
    struct stat lock {};
    if (::fstat(descriptor_, &lock) != 0 || !S_ISREG(lock.st_mode) || !take_lock(descriptor_)) {
      ::close(descriptor_);
      throw Misuse(fmt::format("'{}' belongs to a run that is under way (it holds '{}')", path, name_));
    }
    if (is_at(descriptor_, name_)) return;
    ::close(descriptor_);
  }
}

FileLock::~FileLock() {
  if (descriptor_ < 0) return;
  ::unlink(name_.c_str());  // before it is unlocked: nobody else has it yet
  ::close(descriptor_);
}

}  // namespace diracstep
