#pragma once

#include <functional>
#include <string>
#include <vector>

namespace diracstep {

/// How a program ended.
struct ProcessEnd {
  enum class Kind { not_started, exited, killed, out_of_time } kind;
  int status = 0;  ///< exit status, or the signal
};

/// Runs a program without a shell, its messages in the file `messages`, and waits for it.  It has a process
/// group of its own, which is ended with all that it started after `seconds`, and at once where this process
/// ends, whichever way, or where `go_on`, which is asked every 0.1 s, says no.
ProcessEnd run_process(const std::vector<std::string>& command, const std::string& messages, double seconds,
                       const std::function<bool()>& go_on = {});

}  // namespace diracstep
