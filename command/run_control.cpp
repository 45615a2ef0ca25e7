#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/run_control.hpp>
#include <diracstep/core/adaptive/checked_motion.hpp>
#include <diracstep/core/runs/run.hpp>
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
  start.p = scene.start.p;
  start.energy = scene.energy(scene.start);
  return start;
}

class Run {
 public:
  Run(long steps, EventSteps<Integrator>& motion, const Keeping& keeping, RunResult& result)
      : steps_(steps),
        motion_(motion),
        keeping_(keeping),
        result_(result),
        every_look_(std::max(1L, steps / points_looked_at)),
        next_checkpoint_(Clock::now() + between_checkpoints),
        progress_(static_cast<double>(taken()) / static_cast<double>(steps)),
        checked_(motion,
                 [&motion, steps] { return RunChecks(motion.stepper(), steps - motion.work().steps); }) {
    if (taken() > 0 && std::ranges::none_of(motion.events(), &Event::acts))
      checked_.see(start_of(motion.scene()));
  }

  void go() {
    const long first = taken();
    if (first == 0 || wanted(first)) keep();
    ShownTimes times(times_ahead(), motion_.time(), integrator().options().step, [&](const Sample& sample) {
      keeping_.file->write(sample);
      return true;
    });
    if (keeping_.file != nullptr) motion_.show_at(&times);
    StepReport last = step_while(
        *this, [&](long k) { return first + k < steps_ && result_.failure.empty(); },
        [&](long k) { return visit(first + k); });
    if (last.ok()) last = motion_.show_node();
    motion_.show_at(nullptr);
    if (!last.ok())
      result_.failure = last.failure;
    else if (result_.failure.empty() && !motion_.stopped() && taken() < steps_)
      result_.failure = fmt::format("{} at t = {:.10g}", interruption(), motion_.time());
    if (motion_.stopped())
      end_at(motion_.end_of_stopped());
    else if (motion_.time() != kept_time_)
      keep();
    take_events(motion_, result_);
    result_.work = motion_.work();
    if (result_.failure.empty() && !motion_.stopped()) checked_.finish();
    result_.doubt = checked_.text();
  }

  StepReport step() {
    StepReport report = checked_.step();
    if (motion_.acted() && report.ok() && !motion_.stopped()) look();
    return report;
  }

 private:
  /// What there is to do after step k; whether the run goes on.  The signal is asked for once, and the
  /// checkpoint is saved before the point is kept: a run that goes on from it does not keep the point twice.
  bool visit(long k) {
    if (keeping_.sensitivities != nullptr) keeping_.sensitivities->follow_step();
    if (motion_.stopped()) return false;
    const bool stopped = interrupted();
    if (k == steps_ || stopped || checkpoint_due(k)) save();
    if (wanted(k))
      keep();
    else if (k % every_look_ == 0)
      look();
    if (k % steps_between_looks == 0) show(k);
    return !stopped;
  }

  bool wanted(long k) const {
    return k == steps_ || (keeping_.file != nullptr && keeping_.times.empty() && k % keeping_.every == 0);
  }

  long taken() const { return motion_.work().steps; }
  const Integrator& integrator() const { return motion_.stepper(); }

  /// The point at which an event ends the run is the last one of its file, but where times are chosen.
  void end_at(const Sample& end) {
    if (keeping_.file != nullptr && keeping_.times.empty()) keeping_.file->write(end);
    result_.end = end;
  }

  /// Without those that were shown before a checkpoint.
  std::vector<double> times_ahead() const {
    const double step = integrator().options().step;
    const auto ahead = [&](double t) { return (t - motion_.time()) / step >= -same_time; };
    return {std::ranges::find_if(keeping_.times, ahead), keeping_.times.end()};
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
    Snapshot state;
    motion_.save(state);
    write_checkpoint(keeping_.checkpoint, {keeping_.identity, mark.lines, mark.bytes, std::move(state)});
    next_checkpoint_ = Clock::now() + between_checkpoints;
  }

  void keep() {
    Sample sample;
    const SolveReport report = motion_.sample(sample);
    if (!report.ok()) {
      if (result_.failure.empty())
        result_.failure =
            fmt::format("reading the state at t = {}: {}", motion_.time(), describe(report.status));
      return;
    }
    kept_time_ = motion_.time();
    checked_.see(sample);
    if (keeping_.file != nullptr && keeping_.times.empty()) keeping_.file->write(sample);
    result_.end = std::move(sample);
  }

  /// At the energy only; a point that cannot be read is told of where it is kept.
  void look() {
    if (motion_.stepper().sample(Momentum::projected, looked_at_).ok()) checked_.see(looked_at_);
  }

  void show(long k) {
    progress_.show(static_cast<double>(k) / static_cast<double>(steps_),
                   fmt::format("step {} of {}", k, steps_));
  }

  long steps_;
  EventSteps<Integrator>& motion_;
  const Keeping& keeping_;
  RunResult& result_;
  long every_look_;
  Sample looked_at_;
  double kept_time_ = std::nan("");
  Clock::time_point next_checkpoint_;
  Progress progress_;
  CheckedMotion<Integrator> checked_;
};

}  // namespace

void run_to(long steps, EventSteps<Integrator>& motion, const Keeping& keeping, RunResult& result) {
  Run(steps, motion, keeping, result).go();
}

}  // namespace diracstep::command
