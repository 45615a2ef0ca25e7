#include <unistd.h>

#include <cstdlib>
#include <diracstep/command/command_line.hpp>
#include <diracstep/command/interrupt.hpp>
#if defined(DIRACSTEP_WITH_MPI)
#include <diracstep/command/mpi_processes.hpp>
#endif
#include <exception>
#include <new>
#include <string_view>

namespace {

bool memory_was_short = false;

void note_short_memory() {
  memory_was_short = true;
  throw std::bad_alloc();
}

/// Where memory is short, destructors and functions of the JSON and TOML libraries that may not throw do so,
/// and nobody can catch that.
[[noreturn]] void end_without_memory() {
  if (!memory_was_short) std::abort();
  constexpr std::string_view message =
      "diracstep: there is not enough memory; the files stand as they were last written\n";
  static_cast<void>(!write(STDERR_FILENO, message.data(), message.size()));
  _exit(1);
}

}  // namespace

int main(int count, char** arguments) {
  std::set_new_handler(note_short_memory);
  std::set_terminate(end_without_memory);
  diracstep::command::prepare_standard_streams();
#if defined(DIRACSTEP_WITH_MPI)
  diracstep::command::MpiProcesses mpi(count, arguments);
  const int status = diracstep::command::execute(count, arguments, true, mpi.processes());
  mpi.end(status);
  return status;
#else
  return diracstep::command::execute(count, arguments);
#endif
}
