#pragma once

namespace diracstep::command {

/// Makes standard input, output and error what the rest of the command relies on: one that is closed is taken
/// by /dev/null, so that no file of a run gets its number; a reader of a pipe that is gone and a file at the
/// limit of the shell are errors of write() and no end of the process.
void prepare_standard_streams();

/// From now on SIGINT, SIGTERM and SIGHUP (unless it is ignored, as under nohup) only set a flag, so that
/// what was computed can be kept; before, they end the process.  A second one ends the process at once; one
/// that comes within 0.1 s is the same, as timeout(1) sends it to the process and to its group.  Where the
/// work under way has not come to the flag 0.8 s later, a message says so.
void catch_interrupts();

/// While one lives, what is under way writes no file and can keep no part of its work, as the factorisation
/// of a large matrix: a signal that it does not come to ends the process, with status 1, where else the
/// message would stand.
class NothingKept {
 public:
  NothingKept();
  NothingKept(const NothingKept&) = delete;
  NothingKept& operator=(const NothingKept&) = delete;
  ~NothingKept();
};

/// Sets the flag once `seconds` have passed, and ends the process with status 1 and a message where the work
/// under way has not come to it `grace_seconds` later: a loop in a plugin.
void limit_time(double seconds);
inline constexpr double grace_seconds = 5.0;

/// Whether the flag is set.
bool interrupted();

/// "interrupted" or "stopped by --max-time".
const char* interruption();

}  // namespace diracstep::command
