#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <ctime>
#include <diracstep/scene_format/loader/compiler_process.hpp>

namespace diracstep {

namespace {

// After fork() only what is safe in a signal handler is called: other threads may have held any lock.

constexpr int cannot_start = 127;
constexpr int look_milliseconds = 10, ask_milliseconds = 100;

double now() {
  std::timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

void open_as(int number, const char* path, int how) {
  const int file = open(path, how, 0600);  // NOLINT(cppcoreguidelines-pro-type-vararg)
  if (file < 0) _exit(cannot_start);
  if (file == number) return;
  dup2(file, number);
  close(file);
}

/// What the watcher tells: one of ProcessEnd, as bytes of a pipe.
struct Told {
  int kind = static_cast<int>(ProcessEnd::Kind::not_started), status = 0;
};

[[noreturn]] void become(char* const* arguments, const char* messages, int failed) {
  for (const int signal : {SIGPIPE, SIGXFSZ, SIGINT, SIGTERM, SIGHUP}) std::signal(signal, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  open_as(STDIN_FILENO, "/dev/null", O_RDONLY);
  open_as(STDOUT_FILENO, "/dev/null", O_WRONLY);
  open_as(STDERR_FILENO, messages, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW);
  execvp(arguments[0], arguments);
  const char byte = 1;
  static_cast<void>(!write(failed, &byte, 1));
  _exit(cannot_start);
}

/// Waits for the program, the end of the parent or that of the time; ends the group.
Told watch(pid_t child, int parent, double deadline) {
  for (;;) {
    int status = 0;
    const pid_t ended = waitpid(child, &status, WNOHANG);
    if (ended == child && WIFEXITED(status))
      return {static_cast<int>(ProcessEnd::Kind::exited), WEXITSTATUS(status)};
    if (ended == child) return {static_cast<int>(ProcessEnd::Kind::killed), WTERMSIG(status)};
    if (now() > deadline) return {static_cast<int>(ProcessEnd::Kind::out_of_time), 0};
    pollfd end{parent, POLLIN, 0};
    if (poll(&end, 1, look_milliseconds) > 0) return {static_cast<int>(ProcessEnd::Kind::killed), SIGKILL};
  }
}

/// The watcher: a process that outlives this one just long enough to end the program.
[[noreturn]] void be_watcher(char* const* arguments, const char* messages, int parent, int answer,
                             double seconds) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGALRM}) std::signal(signal, SIG_IGN);
  std::array<int, 2> failed{};
  if (pipe2(failed.data(), O_CLOEXEC) != 0) _exit(1);
  const double deadline = now() + seconds;
  const pid_t child = fork();
  if (child < 0) _exit(1);
  if (child == 0) {
    setpgid(0, 0);
    become(arguments, messages, failed[1]);
  }
  setpgid(child, child);  // here as well: whoever comes first
  close(failed[1]);
  Told told = watch(child, parent, deadline);
  kill(-child, SIGKILL);  // what it has started, too
  char byte = 0;
  if (told.kind == static_cast<int>(ProcessEnd::Kind::exited) && read(failed[0], &byte, 1) == 1) told = {};
  static_cast<void>(!write(answer, &told, sizeof told));
  _exit(0);
}

}  // namespace

ProcessEnd run_process(const std::vector<std::string>& command, const std::string& messages, double seconds,
                       const std::function<bool()>& go_on) {
  std::vector<char*> arguments;
  for (const auto& part : command) arguments.push_back(const_cast<char*>(part.c_str()));
  arguments.push_back(nullptr);
  std::array<int, 2> parent{}, answer{};
  if (pipe2(parent.data(), O_CLOEXEC) != 0) return {ProcessEnd::Kind::not_started};
  if (pipe2(answer.data(), O_CLOEXEC) != 0) {
    for (const int end : parent) close(end);
    return {ProcessEnd::Kind::not_started};
  }
  const pid_t watcher = fork();
  if (watcher == 0) {
    setpgid(0, 0);  // Ctrl-C is for this process; the watcher learns of its end by the pipe
    close(parent[1]);
    be_watcher(arguments.data(), messages.c_str(), parent[0], answer[1], seconds);
  }
  close(parent[0]);
  close(answer[1]);
  Told told;
  if (watcher > 0) {
    pollfd told_by{answer[0], POLLIN, 0};
    while (go_on && poll(&told_by, 1, ask_milliseconds) <= 0)
      if (!go_on()) break;
    if (go_on && !go_on()) {  // the watcher ends the program then
      close(parent[1]);
      parent[1] = -1;
    }
    ssize_t got = 0;
    while ((got = read(answer[0], &told, sizeof told)) < 0 && errno == EINTR) {
    }
    if (got != static_cast<ssize_t>(sizeof told)) told = {};
    while (waitpid(watcher, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
  if (parent[1] >= 0) close(parent[1]);
  close(answer[0]);
  return {static_cast<ProcessEnd::Kind>(told.kind), told.status};
}

}  // namespace diracstep
