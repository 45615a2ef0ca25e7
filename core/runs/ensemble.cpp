#include <algorithm>
#include <atomic>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/ensemble.hpp>
#include <diracstep/core/runs/event_steps.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/runs/step_loop.hpp>
#include <exception>
#include <mutex>
#include <thread>

namespace diracstep {

namespace {

constexpr std::size_t checked_members = 20;
constexpr long points_looked_at = 100;  // for the energy

/// Steps one member after the other, each alone.
using Worker = std::function<EnsembleMember(std::size_t number)>;

void note_reading(const SolveReport& read, EnsembleMember& member) {
  if (!member.last.ok() || read.ok()) return;
  member.last.solve = read;
  member.last.failure = std::string("reading the end: ") + describe(read.status);
}

void take_checked_steps(Integrator& integrator, long steps, EnsembleMember& member) {
  RunChecks checks(integrator, steps);
  member.last = run_steps(integrator, steps, Momentum::projected, std::max(1L, steps / points_looked_at),
                          nullptr, &checks)
                    .last;
  member.doubt = checks.text();
}

Worker worker(const std::shared_ptr<Integrator>& integrator, std::span<const Start> starts, long steps,
              Momentum momentum) {
  const std::size_t between =
      std::max<std::size_t>(1, (starts.size() + checked_members - 1) / checked_members);
  return [=](std::size_t number) {
    EnsembleMember member;
    integrator->reset(starts[number]);
    if (number % between == 0)
      take_checked_steps(*integrator, steps, member);
    else
      member.last = take_steps(*integrator, steps);
    note_reading(integrator->sample(momentum, member.end), member);
    return member;
  };
}

std::shared_ptr<const Scene> started(const std::shared_ptr<const Scene>& scene, const Start& start) {
  if (!scene) return scene;
  auto copy = std::make_shared<Scene>(*scene);
  copy->start = start;
  return copy;
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
                                         int threads, const std::function<bool()>& goes_on,
                                         const EnsembleEvents& events) {
  std::vector<EnsembleMember> members(starts.size());
  const auto make = integrators(registry, solvers, options);
  std::vector<Worker> workers;
  for (std::size_t k = 0; k < thread_count(threads, starts.size()); ++k)
    if (events.events.empty())
      workers.push_back(worker(make(scene), starts, steps, momentum));
    else
      workers.emplace_back([&](std::size_t number) {
        EventSteps<Integrator> motion(started(scene, starts[number]),
                                      started(events.all_rows, starts[number]), events.events, solvers,
                                      momentum, make);
        EnsembleMember member;
        member.last = motion.run(steps, member.end);
        return member;
      });
  std::atomic<std::size_t> next = 0;
  FirstException exception;
  const auto work = [&](const Worker& step) {
    try {
      for (std::size_t k = next++; k < members.size() && (!goes_on || goes_on()); k = next++)
        members[k] = step(k);
    } catch (...) {
      exception.keep();
      next = members.size();  // the others stop after the member they are at
    }
  };
  {
    std::vector<std::jthread> pool;
    for (std::size_t k = 1; k < workers.size(); ++k) pool.emplace_back([&, k] { work(workers[k]); });
    if (!workers.empty()) work(workers.front());
  }
  exception.rethrow();
  return members;
}

}  // namespace diracstep
