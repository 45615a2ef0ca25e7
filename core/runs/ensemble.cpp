#include <algorithm>
#include <atomic>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/ensemble.hpp>
#include <diracstep/core/runs/step_loop.hpp>
#include <exception>
#include <mutex>
#include <thread>

namespace diracstep {

namespace {

EnsembleMember run_member(Integrator& integrator, const Start& start, long steps, Momentum momentum) {
  EnsembleMember member;
  integrator.reset(start);
  member.last = take_steps(integrator, steps);
  const SolveReport read = integrator.sample(momentum, member.end);
  if (member.last.ok() && !read.ok()) {
    member.last.solve = read;
    member.last.failure = std::string("reading the end: ") + describe(read.status);
  }
  return member;
}

/// The first exception that any of the threads met.
class FirstException {
 public:
  void keep() {
    const std::lock_guard lock(mutex_);
    if (!exception_) exception_ = std::current_exception();
  }
  void rethrow() const {
    if (exception_) std::rethrow_exception(exception_);
  }

 private:
  std::mutex mutex_;
  std::exception_ptr exception_;
};

std::size_t thread_count(int asked, std::size_t members) {
  if (asked < 0) throw Misuse("threads = " + std::to_string(asked) + "; 0 or more are needed");
  const std::size_t count =
      asked > 0 ? static_cast<std::size_t>(asked) : std::max(1U, std::thread::hardware_concurrency());
  return std::min(count, members);
}

}  // namespace

std::vector<EnsembleMember> run_ensemble(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                                         const SolverFactory& solvers, const IntegratorOptions& options,
                                         std::span<const Start> starts, long steps, Momentum momentum,
                                         int threads, const std::function<bool()>& goes_on) {
  std::vector<EnsembleMember> members(starts.size());
  std::vector<std::unique_ptr<Integrator>> integrators;
  for (std::size_t k = 0; k < thread_count(threads, starts.size()); ++k)
    integrators.push_back(std::make_unique<Integrator>(scene, registry, solvers, options));
  std::atomic<std::size_t> next = 0;
  FirstException exception;
  const auto work = [&](Integrator& integrator) {
    try {
      for (std::size_t k = next++; k < members.size() && (!goes_on || goes_on()); k = next++)
        members[k] = run_member(integrator, starts[k], steps, momentum);
    } catch (...) {
      exception.keep();
      next = members.size();  // the others stop after the member they are at
    }
  };
  {
    std::vector<std::jthread> pool;
    for (std::size_t k = 1; k < integrators.size(); ++k) pool.emplace_back([&, k] { work(*integrators[k]); });
    if (!integrators.empty()) work(*integrators.front());
  }
  exception.rethrow();
  return members;
}

}  // namespace diracstep
