#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/output_file.hpp>
#include <filesystem>
#include <utility>

namespace diracstep {

namespace {

/// Makes the name of a file last: where a system stops, its folder may be older than its files.
void sync_folder_of(const std::string& path) {
  const auto folder = std::filesystem::path(path).parent_path();
  const int descriptor = ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY);
  if (descriptor < 0) return;  // a folder that may be written but not read: nothing more can be done
  ::fsync(descriptor);
  ::close(descriptor);
}

}  // namespace

OutputFile::OutputFile(const std::string& path, Mode mode) : path_(path) {
  const int how = mode == Mode::fresh ? O_WRONLY | O_CREAT | O_TRUNC : O_RDWR;
  descriptor_ = ::open(path.c_str(), how | O_CLOEXEC, 0666);  // NOLINT(cppcoreguidelines-pro-type-vararg)
  if (descriptor_ < 0) throw Misuse(fmt::format("'{}' cannot be written: {}", path, std::strerror(errno)));
  if (mode == Mode::existing) ::lseek(descriptor_, 0, SEEK_END);
}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : path_(std::move(other.path_)), descriptor_(std::exchange(other.descriptor_, -1)) {}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void OutputFile::write(std::string_view bytes) {
  const off_t begin = ::lseek(descriptor_, 0, SEEK_CUR);  // -1 for a pipe
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

namespace {

void write_once(const std::string& path, std::string_view bytes, bool lasting) {
  OutputFile file(path, OutputFile::Mode::fresh);
  file.write(bytes);
  if (lasting) file.sync();
  file.close();
}

}  // namespace

void replace_file(const std::string& given, std::string_view bytes) {
  namespace fs = std::filesystem;
  std::error_code none;
  const fs::file_status status = fs::status(given, none);
  if (fs::exists(status) && !fs::is_regular_file(status)) return write_once(given, bytes, false);
  const std::string path =
      fs::is_symlink(given, none) && fs::exists(status) ? fs::canonical(given, none).string() : given;
  const std::string fresh = path + ".new";
  try {
    write_once(fresh, bytes, true);
  } catch (const Error&) {
    fs::remove(fresh, none);
    throw;
  }
  if (std::rename(fresh.c_str(), path.c_str()) != 0)
    throw Error(fmt::format("'{}' could not be replaced: {}", path, std::strerror(errno)));
  sync_folder_of(path);
}

}  // namespace diracstep
