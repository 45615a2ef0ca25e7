#include <csignal>
#include <ctime>
#include <diracstep/command/interrupt.hpp>
#include <initializer_list>

namespace diracstep::command {

namespace {

// A signal handler can reach nothing but globals.
volatile std::sig_atomic_t flag = 0;
std::time_t first_time = 0;

/// Only a signal that comes a while after the first ends the process: timeout(1) sends the same one twice.
void raise_flag(int signal) {
  std::timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  if (flag == 0) {
    first_time = now.tv_sec;
    flag = 1;
  } else if (now.tv_sec > first_time + 1) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
}

}  // namespace

void catch_interrupts() {
  struct sigaction action {};
  action.sa_handler = raise_flag;
  action.sa_flags = SA_RESTART;
  sigfillset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM}) sigaction(signal, &action, nullptr);
  std::signal(SIGXFSZ,
              SIG_IGN);  // a file above the limit of the shell is an error of write(), like a full disk
}

bool interrupted() { return flag != 0; }

}  // namespace diracstep::command
