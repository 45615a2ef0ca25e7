#include <fmt/format.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <diracstep/files/shown_text.hpp>
#include <diracstep/reports/plot.hpp>
#include <filesystem>
#include <system_error>

namespace diracstep {

namespace {

/// A terminal for each file, at a width and a height in points.
struct Terminal {
  const char* ending;
  std::string (*settings)(std::size_t width, std::size_t height);
};
constexpr std::array<Terminal, 2> terminals{
    {{".svg",
      [](std::size_t width, std::size_t height) {
        return fmt::format("svg size {},{} font 'Helvetica,Arial,sans-serif,17' background 'white'", width,
                           height);
      }},
     {".png", [](std::size_t width, std::size_t height) {
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

std::string run_gnuplot(const std::string& script) {
  if (std::system("command -v gnuplot >/dev/null 2>&1") != 0)  // NOLINT: a fixed command
    return "gnuplot was not found, so no pictures were drawn (Debian: apt install gnuplot-nox)";
  const PipeSignalBlocked blocked;
  std::FILE* pipe = popen("gnuplot", "w");  // NOLINT: a fixed command
  if (pipe == nullptr) return "gnuplot could not be started";
  const bool written = std::fwrite(script.data(), 1, script.size(), pipe) == script.size();
  const int status = pclose(pipe);
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

std::string render(const std::string& picture, const std::string& stem, std::size_t width,
                   std::size_t height) {
  std::string script;
  for (const auto& [ending, settings] : terminals)
    script += fmt::format("reset\nset terminal {}\nset output {}\n{}unset output\n", settings(width, height),
                          gnuplot_text(stem + ending), picture);
  std::string failure = run_gnuplot(script);
  if (!failure.empty()) return failure;
  for (const auto& [ending, settings] : terminals)
    if (std::error_code error; !std::filesystem::file_size(stem + ending, error))
      return fmt::format("gnuplot did not write {}{}", stem, ending);
  return {};
}

std::string file_name(std::string scene) {
  std::ranges::replace_if(
      scene, [](char c) { return c == '/' || c == '\\'; }, '_');
  return scene;
}

}  // namespace diracstep
