#pragma once

#include <diracstep/command/processes.hpp>

namespace diracstep::command {

/// MPI, where mpirun started the process and the command was built with it; else nothing.  Numbers are drawn
/// from a counter in the memory of rank 0 by MPI_Fetch_and_op, which needs nothing of rank 0 itself.
class MpiProcesses {
 public:
  MpiProcesses(int& count, char**& arguments);
  MpiProcesses(const MpiProcesses&) = delete;
  MpiProcesses& operator=(const MpiProcesses&) = delete;

  Processes processes();
  /// To be called last, by each rank: one that failed ends all, since the others may wait for it.
  void end(int status);

 private:
  struct Memory;
  Memory* memory_ = nullptr;
};

}  // namespace diracstep::command
