#include <mpi.h>

#include <cstdlib>
#include <diracstep/command/mpi_processes.hpp>
#include <diracstep/command/session.hpp>

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

/// All messages at once: no order of them can block.
void exchange_by_mpi(std::span<const Exchanged> messages) {
  std::vector<MPI_Request> requests(2 * messages.size());
  auto* request = requests.data();
  for (const Exchanged& message : messages) {
    MPI_Irecv(message.in.data(), static_cast<int>(message.in.size()), MPI_DOUBLE, message.with, 0,
              MPI_COMM_WORLD, request++);
    MPI_Isend(message.out.data(), static_cast<int>(message.out.size()), MPI_DOUBLE, message.with, 0,
              MPI_COMM_WORLD, request++);
  }
  MPI_Waitall(static_cast<int>(requests.size()), requests.data(), MPI_STATUSES_IGNORE);
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
  all.exchange = exchange_by_mpi;
  all.gather = [count = all.count](double number) {
    std::vector<double> numbers(static_cast<std::size_t>(count));
    MPI_Allgather(&number, 1, MPI_DOUBLE, numbers.data(), 1, MPI_DOUBLE, MPI_COMM_WORLD);
    return numbers;
  };
  return all;
}

void MpiProcesses::end(int status) {
  if (memory_ == nullptr) return;
  if (status == failed || status == misused) MPI_Abort(MPI_COMM_WORLD, status);
  MPI_Win_free(&memory_->window);
  MPI_Finalize();
}

}  // namespace diracstep::command
