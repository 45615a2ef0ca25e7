#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/input_file.hpp>

namespace diracstep {

namespace {

class Descriptor {
 public:
  // O_NONBLOCK: the opening of a pipe that nobody writes to would wait for ever
  explicit Descriptor(const std::string& path)
      : number_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY)) {}  // NOLINT
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int number() const { return number_; }

 private:
  int number_;
};

}  // namespace

std::string read_file(const std::string& path, const std::string& what, std::size_t limit) {
  const auto refuse = [&](const std::string& why) {
    throw Misuse(fmt::format("{} '{}' {}", what, path, why));
  };
  const auto refuse_unread = [&] { refuse(fmt::format("cannot be read: {}", std::strerror(errno))); };
  const auto refuse_large = [&] { refuse(fmt::format("has more than {} bytes, the limit", limit)); };
  const Descriptor file(path);
  struct stat status {};
  if (file.number() < 0 || ::fstat(file.number(), &status) != 0) refuse_unread();
  if (!S_ISREG(status.st_mode)) refuse("is no regular file");
  if (static_cast<std::size_t>(status.st_size) > limit) refuse_large();
  std::string bytes(static_cast<std::size_t>(status.st_size) + 1, '\0');  // one more shows a file that grows
  std::size_t size = 0;
  for (;;) {
    const ssize_t count = ::read(file.number(), bytes.data() + size, bytes.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) refuse_unread();
    size += static_cast<std::size_t>(count);
    if (size > limit) refuse_large();
    if (count == 0) break;
    if (size == bytes.size()) bytes.resize(2 * size);
  }
  bytes.resize(size);
  return bytes;
}

}  // namespace diracstep
