#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <diracstep/command/progress.hpp>
#include <diracstep/files/shown_text.hpp>

namespace diracstep {

namespace {

using namespace std::chrono_literals;

constexpr auto between_changes = 100ms;
constexpr auto quiet_at_first = 300ms;  // what is over at once shows nothing
constexpr int bar_cells = 24;

std::string duration(double seconds) {
  if (seconds < 60.0) return fmt::format("{:.0f} s", seconds);
  if (seconds < 3600.0)
    return fmt::format("{:.0f} min {:.0f} s", std::floor(seconds / 60.0), std::fmod(seconds, 60.0));
  return fmt::format("{:.1f} h", seconds / 3600.0);
}

std::size_t terminal_width() {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

std::string bar(double part) {
  const int filled = static_cast<int>(part * bar_cells);
  return std::string(static_cast<std::size_t>(filled), '#') +
         std::string(static_cast<std::size_t>(bar_cells - filled), '.');
}

}  // namespace

Progress::Progress(double done_before)
    : terminal_(isatty(STDERR_FILENO) == 1),
      done_before_(done_before),
      start_(Clock::now()),
      next_(start_ + quiet_at_first) {}

Progress::~Progress() { wipe(); }

void Progress::show(double part, const std::string& what) {
  if (!terminal_ || Clock::now() < next_) return;
  next_ = Clock::now() + between_changes;
  part = std::clamp(part, 0.0, 1.0);
  const double elapsed = std::chrono::duration<double>(Clock::now() - start_).count();
  std::string line = fmt::format("[{}] {:3.0f} %", bar(part), 100.0 * part);
  const double done = part - done_before_;
  if (done > 0.02 * (1.0 - done_before_))
    line += fmt::format(", about {} left", duration(elapsed * (1.0 - part) / done));
  line += "  " + shown_line(what);
  if (line.size() >= terminal_width()) line.resize(terminal_width() - 1);
  line = '\r' + line + "\x1b[K";
  std::fwrite(line.data(), 1, line.size(), stderr);
  std::fflush(stderr);
  shown_ = true;
}

void Progress::wipe() {
  if (!shown_) return;
  std::fputs("\r\x1b[K", stderr);
  std::fflush(stderr);
  shown_ = false;
}

}  // namespace diracstep
