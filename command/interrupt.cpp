#include <fcntl.h>
#include <sys/time.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <cstring>
#include <ctime>
#include <diracstep/command/interrupt.hpp>
#include <initializer_list>

namespace diracstep::command {

namespace {

// A signal handler can reach nothing but globals, and call only what is safe there: write, _exit, clocks.
volatile std::sig_atomic_t flag = 0;
volatile std::sig_atomic_t out_of_time = 0;  ///< the flag was set by the clock
volatile std::sig_atomic_t nothing_kept = 0;
double first_time = 0.0;

constexpr double same_signal = 0.1;  ///< seconds
constexpr double patience = 0.8;

double now() {
  std::timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

void tell(const char* message) {
  const ssize_t ignored = write(STDERR_FILENO, message, std::strlen(message));
  static_cast<void>(ignored);  // there is nobody else to tell
}

void set_timer(double seconds) {
  itimerval timer{};
  timer.it_value.tv_sec = static_cast<time_t>(seconds);
  timer.it_value.tv_usec = static_cast<suseconds_t>((seconds - std::floor(seconds)) * 1e6);
  if (timer.it_value.tv_sec == 0 && timer.it_value.tv_usec == 0) timer.it_value.tv_usec = 1;
  setitimer(ITIMER_REAL, &timer, nullptr);
}

void raise_flag(int signal) {
  if (flag == 0) {
    first_time = now();
    flag = 1;
    set_timer(patience);
  } else if (out_of_time != 0 || now() > first_time + same_signal) {
    tell("\ndiracstep: ended at once by a second signal; the files stand as they were last written\n");
    std::signal(signal, SIG_DFL);
    std::raise(signal);  // comes when this handler returns
  }
}

void on_timer(int) {
  if (flag == 0) {
    out_of_time = 1;
    flag = 1;
    set_timer(grace_seconds);
  } else if (nothing_kept != 0) {
    tell("\ndiracstep: interrupted in the middle of a computation, of which nothing can be kept\n");
    _exit(1);
  } else if (out_of_time == 0) {
    tell(
        "\ndiracstep: the step or phase under way has not ended yet; a second signal ends the run at once\n");
  } else {
    tell(
        "\ndiracstep: --max-time: the step or phase under way does not end, so the run ends here; the "
        "files "
        "stand as they were last written\n");
    _exit(1);
  }
}

void handle(int signal, void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;
  sigfillset(&action.sa_mask);
  sigaction(signal, &action, nullptr);
}

bool is_ignored(int signal) {
  struct sigaction action {};
  return sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

}  // namespace

void prepare_standard_streams() {
  for (const int number : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (fcntl(number, F_GETFD) <
        0)  // what is printed to a closed output still fails: it is opened for reading
      static_cast<void>(open("/dev/null", number == STDERR_FILENO ? O_WRONLY : O_RDONLY));  // NOLINT
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
}

void catch_interrupts() {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP})
    if (signal != SIGHUP || !is_ignored(signal)) handle(signal, raise_flag);
  handle(SIGALRM, on_timer);
}

void limit_time(double seconds) { set_timer(seconds); }

NothingKept::NothingKept() { nothing_kept = 1; }
NothingKept::~NothingKept() { nothing_kept = 0; }

bool interrupted() { return flag != 0; }

const char* interruption() { return out_of_time != 0 ? "stopped by --max-time" : "interrupted"; }

}  // namespace diracstep::command
