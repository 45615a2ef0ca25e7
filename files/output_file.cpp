#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/file_lock.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/files/paths.hpp>
#include <filesystem>
#include <utility>

namespace diracstep {

void sync_folder(const std::string& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);  // NOLINT
  if (descriptor < 0) return;  // a folder that may be written but not read: nothing more can be done
  ::fsync(descriptor);
  ::close(descriptor);
}

namespace {

void sync_folder_of(const std::string& path) {
  const auto folder = std::filesystem::path(path).parent_path();
  sync_folder(folder.empty() ? "." : folder.string());
}

}  // namespace

OutputFile::OutputFile(const std::string& path, Mode mode) : path_(path) {
  // Emptied once it is locked; O_NONBLOCK: a pipe that nobody reads is refused instead of waited for.
  const int how = mode == Mode::fresh ? O_WRONLY | O_CREAT : O_RDWR;
  descriptor_ = ::open(path.c_str(), how | O_CLOEXEC | O_NONBLOCK | O_NOCTTY, 0666);  // NOLINT
  if (descriptor_ < 0) throw Misuse(fmt::format("'{}' cannot be written: {}", path, std::strerror(errno)));
  ::fcntl(descriptor_, F_SETFL, ::fcntl(descriptor_, F_GETFL) & ~O_NONBLOCK);  // NOLINT
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0 || !S_ISREG(status.st_mode)) return;
  if (!take_lock(descriptor_)) {
    ::close(descriptor_);
    throw Misuse(fmt::format("'{}' cannot be written: another run is writing it", path));
  }
  name_is_new_ = mode == Mode::fresh;
  if (mode == Mode::fresh && ::ftruncate(descriptor_, 0) != 0) refuse("could not be cut");
  if (mode == Mode::existing) ::lseek(descriptor_, 0, SEEK_END);
}

OutputFile OutputFile::on_standard_output() {
  OutputFile file;
  file.path_ = "standard output";
  file.shared_ = true;
  file.descriptor_ = ::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0);  // NOLINT
  if (file.descriptor_ < 0) throw Misuse(fmt::format("standard output is closed: {}", std::strerror(errno)));
  return file;
}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      shared_(other.shared_),
      name_is_new_(other.name_is_new_) {}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void OutputFile::write(std::string_view bytes) {
  const off_t begin = shared_ ? -1 : ::lseek(descriptor_, 0, SEEK_CUR);  // -1 for a pipe as well
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      const int error = errno;
      if (begin >= 0 && ::ftruncate(descriptor_, begin) == 0) ::lseek(descriptor_, begin, SEEK_SET);
      errno = error;
      refuse("could not be written in full");
    }
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void OutputFile::sync() {
  // EINVAL: a pipe or a device, which has nothing to synchronise
  if (::fsync(descriptor_) != 0 && errno != EINVAL && errno != EROFS) refuse("could not be written in full");
  if (std::exchange(name_is_new_, false)) sync_folder_of(path_);
}

void OutputFile::close() {
  if (descriptor_ >= 0 && ::close(std::exchange(descriptor_, -1)) != 0)
    refuse("could not be written in full");
}

void OutputFile::cut(long size) {
  if (::ftruncate(descriptor_, size) != 0) refuse("could not be cut");
  ::lseek(descriptor_, 0, SEEK_END);
}

long OutputFile::size() const {
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0) refuse("could not be examined");
  return status.st_size;
}

std::string OutputFile::beginning(long count) const {
  std::string bytes(static_cast<std::size_t>(count), '\0');
  const ssize_t read = ::pread(descriptor_, bytes.data(), bytes.size(), 0);
  if (read < 0) refuse("could not be read");
  bytes.resize(static_cast<std::size_t>(read));
  return bytes;
}

void OutputFile::refuse(const char* what) const {
  throw Error(fmt::format("'{}' {}: {}", path_, what, std::strerror(errno)));
}

Replacement::Replacement(const std::string& path) : path_(path), fresh_(path + ".new") {
  // O_EXCL follows no link: whatever stands in the way is never written to
  for (int attempts = 0; descriptor_ < 0; ++attempts) {
    descriptor_ =
        ::open(fresh_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);  // NOLINT
    if (descriptor_ < 0 && (errno != EEXIST || attempts > 2 || !remove_leftover()))
      throw Misuse(fmt::format("'{}' cannot be written: '{}': {}", path, fresh_, std::strerror(errno)));
  }
  take_lock(descriptor_);
  struct stat old {};
  if (::stat(path.c_str(), &old) == 0) ::fchmod(descriptor_, old.st_mode & 0777);
}

Replacement::~Replacement() {
  if (descriptor_ < 0) return;
  ::unlink(fresh_.c_str());
  ::close(descriptor_);
}

void Replacement::write(std::string_view bytes) const {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) refuse("could not be written in full");
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void Replacement::become() {
  if (::fsync(descriptor_) != 0) refuse("could not be written in full");
  if (std::rename(fresh_.c_str(), path_.c_str()) != 0) refuse("could not be replaced");
  ::close(std::exchange(descriptor_, -1));
  sync_folder_of(path_);
}

/// What a killed process left: a regular file that nobody has locked.
bool Replacement::remove_leftover() const {
  const int left = ::open(fresh_.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);  // NOLINT
  if (left < 0) {
    errno = EEXIST;
    return false;
  }
  struct stat status {};
  const bool removed = ::fstat(left, &status) == 0 && S_ISREG(status.st_mode) && take_lock(left) &&
                       ::unlink(fresh_.c_str()) == 0;
  ::close(left);
  errno = EEXIST;
  return removed;
}

void Replacement::refuse(const char* what) const {
  throw Error(fmt::format("'{}' {}: {}", path_, what, std::strerror(errno)));
}

namespace {

void write_to_device(const std::string& path, std::string_view bytes) {
  OutputFile file(path, OutputFile::Mode::fresh);
  file.write(bytes);
  file.close();
}

}  // namespace

void replace_file(const std::string& given, std::string_view bytes) {
  namespace fs = std::filesystem;
  std::error_code none;
  const fs::file_status status = fs::status(given, none);
  if (fs::exists(status) && !fs::is_regular_file(status)) return write_to_device(given, bytes);
  Replacement fresh(behind_links(given));
  fresh.write(bytes);
  fresh.become();
}

}  // namespace diracstep
