#include <mpi.h>

#include <cstdlib>
#include <diracstep/command/mpi_processes.hpp>

namespace diracstep::command {

struct MpiProcesses::Memory {
  MPI_Win window = MPI_WIN_NULL;
  long* counter = nullptr;
};

namespace {

/// OpenMPI, MPICH and its kin, Slurm's srun: MPI_Init outside takes a tenth of a second for nothing.
bool started_by_mpirun() {
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK"})
    if (std::getenv(name) != nullptr) return true;
  return false;
}

}  // namespace

MpiProcesses::MpiProcesses(int& count, char**& arguments) {
  if (!started_by_mpirun()) return;
  int provided = 0, number = 0;
  MPI_Init_thread(&count, &arguments, MPI_THREAD_FUNNELED, &provided);
  MPI_Comm_rank(MPI_COMM_WORLD, &number);
  memory_ = new Memory;  // until the process ends
  MPI_Win_allocate(number == 0 ? sizeof(long) : 0, sizeof(long), MPI_INFO_NULL, MPI_COMM_WORLD,
                   &memory_->counter, &memory_->window);
  if (number == 0) *memory_->counter = 0;
  MPI_Barrier(MPI_COMM_WORLD);
}

Processes MpiProcesses::processes() {
  Processes all;
  if (memory_ == nullptr) return all;
  MPI_Comm_rank(MPI_COMM_WORLD, &all.number);
  MPI_Comm_size(MPI_COMM_WORLD, &all.count);
  all.draw = [this] {
    const long one = 1;
    long drawn = 0;
    MPI_Win_lock(MPI_LOCK_EXCLUSIVE, 0, 0, memory_->window);
    MPI_Fetch_and_op(&one, &drawn, MPI_LONG, 0, 0, MPI_SUM, memory_->window);
    MPI_Win_unlock(0, memory_->window);
    return drawn;
  };
  all.meet = [] { MPI_Barrier(MPI_COMM_WORLD); };
  return all;
}

void MpiProcesses::end(int status) {
  if (memory_ == nullptr) return;
  if (status != 0) MPI_Abort(MPI_COMM_WORLD, status);
  MPI_Win_free(&memory_->window);
  MPI_Finalize();
}

}  // namespace diracstep::command
