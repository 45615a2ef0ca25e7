#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/run_control.hpp>
#include <diracstep/core/runs/event_search.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <diracstep/core/runs/step_loop.hpp>

namespace diracstep::command {

namespace {

using Clock = std::chrono::steady_clock;

constexpr double same_time = 1e-9;  ///< in steps
constexpr long steps_between_looks = 256;
constexpr long points_looked_at = 400;  ///< for the energy
constexpr auto between_checkpoints = std::chrono::seconds(10);

/// What the energy doubt reads of the point where a resumed run once began.
Sample start_of(const Scene& scene) {
  Sample start;
  start.time = scene.start.time;
  start.q = scene.start.q;
  start.v = scene.start.v;
  start.energy = scene.energy(start.time, start.q, start.v);
  return start;
}

class Run {
 public:
  Run(long steps, Integrator& integrator, const Keeping& keeping, RunResult& result)
      : steps_(steps),
        integrator_(integrator),
        keeping_(keeping),
        result_(result),
        doubt_(integrator, steps - integrator.work().steps),
        events_(keeping.events, !integrator.scene().lagrangian),
        every_look_(std::max(1L, steps / points_looked_at)),
        next_checkpoint_(Clock::now() + between_checkpoints),
        progress_(static_cast<double>(integrator.work().steps) / static_cast<double>(steps)) {
    if (integrator.work().steps > 0) doubt_.see(start_of(integrator.scene()));
    const auto before_here = [&](double t) { return ahead_of_here(t) < -same_time; };
    next_time_ = std::ranges::find_if_not(keeping.times, before_here);
  }

  void go() {
    const long first = integrator_.work().steps;
    if (first == 0 || wanted(first)) keep();
    keep_chosen_times();
    look_for_events();
    CheckedSteps steps{integrator_, &doubt_};
    const StepReport last = step_while(
        steps, [&](long k) { return first + k < steps_ && result_.failure.empty(); },
        [&](long k) { return visit(first + k); });
    if (!last.ok())
      result_.failure = last.failure;
    else if (result_.failure.empty() && !events_.stopped() && integrator_.work().steps < steps_)
      result_.failure = fmt::format("{} at t = {:.10g}", interruption(), integrator_.time());
    if (events_.stopped())
      end_at(events_.hits().back().sample);
    else if (integrator_.time() != kept_time_)
      keep();
    result_.events = events_.events();
    result_.hits = events_.hits();
    result_.stopped = events_.stopped();
    result_.work = integrator_.work();
    if (result_.failure.empty() && !result_.stopped) doubt_.finish(integrator_);
    result_.doubt = doubt_.text();
  }

 private:
  /// What there is to do after step k; whether the run goes on.  The signal is asked for once, and the
  /// checkpoint is saved before the point is kept: a run that goes on from it does not keep the point twice.
  bool visit(long k) {
    look_for_events();
    if (events_.stopped()) return false;
    const bool stopped = interrupted();
    if (k == steps_ || stopped || checkpoint_due(k)) save();
    if (wanted(k))
      keep();
    else if (k % every_look_ == 0)
      look();
    keep_chosen_times();
    if (k % steps_between_looks == 0) show(k);
    return !stopped;
  }

  bool wanted(long k) const {
    return k == steps_ || (keeping_.file != nullptr && keeping_.times.empty() && k % keeping_.every == 0);
  }

  /// Between the last node and this one.
  void look_for_events() {
    if (events_.empty()) return;
    Sample here;
    const auto read = [&](double t, Sample& sample) {
      return sample_at(integrator_, t, keeping_.momentum, sample);
    };
    StepReport report;
    report.solve = integrator_.sample(keeping_.momentum, here);
    if (report.ok()) report = events_.see(here, read);
    if (!report.ok() && result_.failure.empty())
      result_.failure = fmt::format("looking for events before t = {:g}: {}", integrator_.time(),
                                    report.failure.empty() ? describe(report.solve.status) : report.failure);
  }

  /// The point at which an event ends the run is the last one of its file.
  void end_at(const Sample& sample) {
    if (keeping_.file != nullptr) keeping_.file->write(sample);
    result_.end = sample;
  }

  /// In steps of this run.
  double ahead_of_here(double t) const { return (t - integrator_.time()) / integrator_.options().step; }

  /// The chosen times from this node to the next one; those at the next one are read there.
  void keep_chosen_times() {
    if (keeping_.file == nullptr) return;
    const bool last = integrator_.work().steps >= steps_;
    for (; next_time_ != keeping_.times.end() && result_.failure.empty(); ++next_time_) {
      if (ahead_of_here(*next_time_) >= 1.0 - same_time && !last) return;
      const bool at_node = std::abs(ahead_of_here(*next_time_)) <= same_time;
      Sample sample;
      const StepReport report =
          sample_at(integrator_, at_node ? integrator_.time() : *next_time_, keeping_.momentum, sample);
      if (!report.ok()) {
        result_.failure = report.failure;
        return;
      }
      sample.time = *next_time_;
      keeping_.file->write(sample);
    }
  }

  bool checkpoint_due(long k) const {
    if (keeping_.checkpoint.empty()) return false;
    if (keeping_.checkpoint_every > 0) return k % keeping_.checkpoint_every == 0;
    return k % steps_between_looks == 0 && Clock::now() >= next_checkpoint_;
  }

  void save() {
    if (keeping_.checkpoint.empty()) return;
    const TrajectoryFile::Mark mark =
        keeping_.file != nullptr ? keeping_.file->sync() : TrajectoryFile::Mark{};
    write_checkpoint(keeping_.checkpoint, {keeping_.identity, mark.lines, mark.bytes, integrator_.save()});
    next_checkpoint_ = Clock::now() + between_checkpoints;
  }

  void keep() {
    Sample sample;
    const SolveReport report = integrator_.sample(keeping_.momentum, sample);
    if (!report.ok()) {
      if (result_.failure.empty())
        result_.failure =
            fmt::format("reading the state at t = {}: {}", integrator_.time(), describe(report.status));
      return;
    }
    kept_time_ = integrator_.time();
    doubt_.see(sample);
    if (keeping_.file != nullptr && keeping_.times.empty()) keeping_.file->write(sample);
    result_.end = std::move(sample);
  }

  /// At the energy only; a point that cannot be read is told of where it is kept.
  void look() {
    if (integrator_.sample(Momentum::projected, looked_at_).ok()) doubt_.see(looked_at_);
  }

  void show(long k) {
    progress_.show(static_cast<double>(k) / static_cast<double>(steps_),
                   fmt::format("step {} of {}", k, steps_));
  }

  long steps_;
  Integrator& integrator_;
  const Keeping& keeping_;
  RunResult& result_;
  RunChecks doubt_;
  EventSearch events_;
  long every_look_;
  Sample looked_at_;
  std::vector<double>::const_iterator next_time_;
  double kept_time_ = std::nan("");
  Clock::time_point next_checkpoint_;
  Progress progress_;
};

}  // namespace

void run_to(long steps, Integrator& integrator, const Keeping& keeping, RunResult& result) {
  Run(steps, integrator, keeping, result).go();
}

}  // namespace diracstep::command
