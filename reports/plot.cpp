#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/files/shown_text.hpp>
#include <diracstep/files/temporary_folder.hpp>
#include <diracstep/reports/plot.hpp>
#include <string_view>
#include <utility>

namespace diracstep {

namespace {

constexpr std::size_t largest_picture = std::size_t{1} << 28;

/// A terminal for each file, at a width and a height in points.
struct Terminal {
  const char *ending, *end;  ///< of the name, and what stands at the end of a whole file
  std::string (*settings)(std::size_t width, std::size_t height);
};
constexpr std::array<Terminal, 2> terminals{
    {{".svg", "</svg>",
      [](std::size_t width, std::size_t height) {
        return fmt::format("svg size {},{} font 'Helvetica,Arial,sans-serif,17' background 'white'", width,
                           height);
      }},
     {".png", "IEND", [](std::size_t width, std::size_t height) {
        return fmt::format("pngcairo size {},{} font 'Helvetica,15' fontscale 1.9 linewidth 2 pointscale 2",
                           2 * width, 2 * height);
      }}}};

/// A pipe's reader may be gone; the error is then read off its exit status, not off a signal.
class PipeSignalBlocked {
 public:
  PipeSignalBlocked() {
    sigemptyset(&pipe_);
    sigaddset(&pipe_, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &pipe_, &before_);
  }
  PipeSignalBlocked(const PipeSignalBlocked&) = delete;
  PipeSignalBlocked& operator=(const PipeSignalBlocked&) = delete;
  ~PipeSignalBlocked() {
    const timespec now{};
    if (sigismember(&before_, SIGPIPE) == 0) sigtimedwait(&pipe_, nullptr, &now);
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }

 private:
  sigset_t pipe_, before_;
};

/// A pipe to a gnuplot in a process group of its own, which an interrupt from the terminal does not reach,
/// and whose messages nobody sees: what failed is read off its exit status.
class Gnuplot {
 public:
  Gnuplot() {
    std::array<int, 2> pipe{};
    if (::pipe2(pipe.data(), O_CLOEXEC) != 0) return;
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_init(&actions);
    posix_spawnattr_init(&attributes);
    posix_spawn_file_actions_adddup2(&actions, pipe[0], STDIN_FILENO);
    for (const int stream : {STDOUT_FILENO, STDERR_FILENO})
      posix_spawn_file_actions_addopen(&actions, stream, "/dev/null", O_WRONLY, 0);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    std::string name = "gnuplot";
    const std::array<char*, 2> arguments{name.data(), nullptr};
    failure_ = posix_spawnp(&process_, name.c_str(), &actions, &attributes, arguments.data(), environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    ::close(pipe[0]);
    if (failure_ == 0)
      input_ = pipe[1];
    else
      ::close(pipe[1]);
  }
  Gnuplot(const Gnuplot&) = delete;
  Gnuplot& operator=(const Gnuplot&) = delete;
  ~Gnuplot() { finish(); }

  int failure() const { return failure_; }  ///< to start, as errno

  bool write(std::string_view script) const {
    while (!script.empty()) {
      const ssize_t written = ::write(input_, script.data(), script.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) return false;
      script.remove_prefix(static_cast<std::size_t>(written));
    }
    return true;
  }

  /// Ends the script and waits; the status as waitpid() gives it.
  int finish() {
    if (input_ < 0) return -1;
    ::close(std::exchange(input_, -1));
    int status = -1;
    while (::waitpid(process_, &status, 0) < 0 && errno == EINTR) {
    }
    return status;
  }

 private:
  int failure_ = EAGAIN;
  pid_t process_ = -1;
  int input_ = -1;
};

std::string run_gnuplot(const std::string& script) {
  const PipeSignalBlocked blocked;
  Gnuplot gnuplot;
  if (gnuplot.failure() == ENOENT)
    return "gnuplot was not found, so no pictures were drawn (Debian: apt install gnuplot-nox)";
  if (gnuplot.failure() != 0)
    return fmt::format("gnuplot could not be started: {}", std::strerror(gnuplot.failure()));
  const bool written = gnuplot.write(script);
  const int status = gnuplot.finish();
  if (written && WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
  return fmt::format("gnuplot failed with status {}", WIFEXITED(status) ? WEXITSTATUS(status) : status);
}

}  // namespace

std::string gnuplot_text(std::string_view text) {
  std::string all = "'";
  for (const char c : shown_line(text))  // a line end would begin a command
    all += c == '\'' ? std::string("''") : std::string(1, c);
  return all + "'";
}

std::vector<std::string> picture_files(const std::string& stem) {
  std::vector<std::string> files;
  for (const Terminal& terminal : terminals) files.push_back(stem + terminal.ending);
  return files;
}

/// gnuplot draws elsewhere, so that a picture that is there stays until the next one is whole.
std::string render(const std::string& picture, const std::string& stem, std::size_t width,
                   std::size_t height) try {
  const TemporaryFolder folder("plot");
  const auto drawn = [&](const Terminal& terminal) {
    return folder.file(std::string("picture") + terminal.ending);
  };
  std::string script;
  for (const Terminal& terminal : terminals)
    script += fmt::format("reset\nset terminal {}\nset output {}\n{}unset output\n",
                          terminal.settings(width, height), gnuplot_text(drawn(terminal)), picture);
  if (std::string failure = run_gnuplot(script); !failure.empty()) return failure;
  for (const Terminal& terminal : terminals) {
    const std::string bytes = read_file(drawn(terminal), "the picture", largest_picture);
    if (bytes.find(terminal.end) == std::string::npos)  // gnuplot does not tell of a full disk
      return fmt::format("{}{}: gnuplot did not draw all of it; is the disk full?", stem, terminal.ending);
    replace_file(stem + terminal.ending, bytes);
  }
  return {};
} catch (const Error& error) {
  return error.what();
}

std::string file_name(std::string scene) {
  std::ranges::replace_if(
      scene, [](char c) { return c == '/' || c == '\\'; }, '_');
  return scene;
}

}  // namespace diracstep
