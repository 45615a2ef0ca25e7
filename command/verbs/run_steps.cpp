#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/run_control.hpp>
#include <diracstep/command/run_identity.hpp>
#include <diracstep/command/verbs/run_steps.hpp>
#include <diracstep/command/verbs/run_times.hpp>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/adaptive/checked_motion.hpp>
#include <diracstep/core/adaptive/variable_run_checks.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/event_steps.hpp>
#include <diracstep/core/runs/run.hpp>
#include <functional>
#include <memory>

namespace diracstep::command {

namespace {

constexpr long most_fixed_steps = 1'000'000'000'000;

StepGrid fitted_steps(const CatalogueScene& entry, double end, double step, const RunArguments& options) {
  const StepGrid grid = fit_steps(entry.scene->start.time, end, step);
  if (const long most = options.max_steps.value_or(most_fixed_steps); grid.steps > most)
    throw Misuse(fmt::format("{} steps of {:g} lead to t = {:g}; --max-steps allows {}", grid.steps,
                             grid.step, end, most));
  if (std::abs(grid.step - step) > 1e-9 * std::abs(step))
    say(fmt::format("step {:g} adjusted to {:.10g}, so that {} steps end at t = {:g}", step, grid.step,
                    grid.steps, end));
  return grid;
}

/// The columns of a trajectory that its scene does not have of itself.
std::vector<Output> further_columns(const CatalogueScene& entry) {
  std::vector<Output> columns;
  const bool by_momentum = !entry.scene->lagrangian;
  for (const Invariant& invariant : entry.invariants)
    columns.push_back(
        {"invariant_" + invariant.name, [at = invariant.at, by_momentum](const MotionPoint& point) {
           return at(point.t, point.q, by_momentum ? point.p : point.v);
         }});
  columns.insert(columns.end(), entry.outputs.begin(), entry.outputs.end());
  return columns;
}

}  // namespace

void open_trajectory(std::optional<TrajectoryFile>& file, const RunArguments& options,
                     const CatalogueScene& entry, const std::optional<Checkpoint>& saved,
                     const std::vector<Output>& sensitivities) {
  if (options.out.empty()) return;
  if (!sensitivities.empty()) {
    std::vector<Output> columns = further_columns(entry);
    columns.insert(columns.end(), sensitivities.begin(), sensitivities.end());
    file.emplace(options.out, entry.shown(), columns);
  } else if (saved) {
    file.emplace(options.out, entry.shown(), TrajectoryFile::Mark{saved->points, saved->bytes},
                 further_columns(entry));
  } else {
    file.emplace(options.out, entry.shown(), further_columns(entry));
  }
  file->show_forces(
      [&entry](const Sample& sample) { return shown_forces(entry, sample.time, sample.q, sample.lambda); });
}

void finish_trajectory(std::optional<TrajectoryFile>& file, const RunArguments& options, RunResult& result) {
  if (!file) return;
  file->close();
  result.out = options.out == standard_output ? "standard output" : options.out;
  result.lines = file->lines();
  say(fmt::format("{} points written to {}", result.lines, result.out));
}

namespace {

void go_on(const Checkpoint& saved, const RunArguments& options, EventSteps<Integrator>& motion) {
  try {
    SnapshotReader reader(saved.state);
    motion.restore(reader);
    reader.require_end();
  } catch (const Misuse& misuse) {
    throw Misuse(fmt::format("--resume: '{}': {}", options.resume, misuse.what()));
  }
  say(fmt::format("going on from step {}, t = {:g}", motion.work().steps, motion.time()));
}

/// Steps of one size to the end, from the start or from a checkpoint.
void run_fixed(const RunArguments& options, const CatalogueScene& entry, const Session& session,
               EventSteps<Integrator>& motion, long steps, std::optional<TrajectoryFile>& file,
               RunResult& result) {
  const Integrator& integrator = motion.stepper();
  Keeping keeping{.momentum = result.momentum, .every = options.every};
  const double start = entry.scene->start.time, step = integrator.options().step,
               end = start + static_cast<double>(steps) * step;
  keeping.times = chosen_times(options, entry, end);
  require_within(keeping.times, start, end, step);
  keeping.checkpoint = checkpoint_path(options);
  keeping.checkpoint_every = options.checkpoint_every;
  if (!keeping.checkpoint.empty())  // else nothing is saved or compared, and no plugin has to be read for it
    keeping.identity =
        run_identity(entry, session, options.method, integrator, keeping, !options.out.empty());
  std::optional<Checkpoint> saved;
  if (!options.resume.empty()) {
    saved = read_checkpoint(options.resume);
    require_same_run(*saved, keeping.identity, options.resume);
    go_on(*saved, options, motion);
    if (motion.work().steps > steps)
      throw Misuse(fmt::format("--resume: '{}' stands at t = {:g}, behind the end at {:g}", options.resume,
                               motion.time(), end));
  }
  std::optional<RunSensitivities> derivatives;
  if (!options.sensitivities.empty())
    derivatives.emplace(names("--sensitivities", options.sensitivities), options.scene,
                        parameters(options.set), entry, session.registry, motion.stepper());
  open_trajectory(file, options, entry, saved, derivatives ? derivatives->columns() : std::vector<Output>{});
  if (file) keeping.file = &*file;
  if (derivatives) keeping.sensitivities = &*derivatives;
  run_to(steps, motion, keeping, result);
  if (derivatives && result.failure.empty()) result.sensitivities = derivatives->read();
  if (derivatives) result.doubt = joined_doubts({result.doubt, derivatives->doubt()});
}

/// Variable steps to the end of a motion without events.
void run_variable(const RunArguments& options, const CatalogueScene& entry, AdaptiveIntegrator& integrator,
                  VariableRunChecks& checks, double end, TrajectoryFile* file, RunResult& result) {
  Progress progress;
  const double start = entry.scene->start.time;
  const auto keep = [&](const Sample& sample) {
    if (file != nullptr) file->write(sample);
    result.end = sample;
    progress.show((sample.time - start) / (end - start), fmt::format("t = {:g}", sample.time));
    return !interrupted();
  };
  result.failure = run_until(integrator, end, result.momentum, options.every, keep, &checks).last.failure;
  if (result.failure.empty() && interrupted())
    result.failure = fmt::format("{} at t = {:.10g}", interruption(), integrator.time());
  result.work = integrator.work();
  if (result.failure.empty()) checks.finish();
  result.doubt = checks.text();
}

using VariableMotion = EventSteps<AdaptiveIntegrator>;

/// Variable steps through the events of a scene, to the end; the file gets each point, or the times chosen.
void run_variable(const RunArguments& options, const std::vector<double>& times, VariableMotion& motion,
                  const std::function<Integrator()>& side, double end, TrajectoryFile* file,
                  RunResult& result) {
  CheckedMotion<AdaptiveIntegrator> checked(motion,
                                            [&] { return VariableRunChecks(motion.stepper(), side()); });
  const auto write = [&](const Sample& sample) {
    if (file != nullptr) file->write(sample);
    return true;
  };
  ShownTimes shown(times, motion.time(), motion.stepper().next_size(), write);
  const auto keep = [&](const Sample& sample) {
    if (times.empty()) write(sample);
    result.end = sample;
    return true;
  };
  result.failure =
      run_through_events(checked, {.end = end, .every = options.every, .times = &shown}, keep, [] {
        return !interrupted();
      }).failure;
  if (result.failure.empty() && interrupted())
    result.failure = fmt::format("{} at t = {:.10g}", interruption(), motion.time());
  take_events(motion, result);
  result.work = motion.work();
  result.doubt = checked.text();
}

void tell_control(const AdaptiveIntegrator& integrator, RunResult& result) {
  result.variable =
      VariableSteps{integrator.adaptive().eps, integrator.adaptive().control, integrator.control()};
  const std::string told = warning(*result.variable, result.work.steps);
  if (!told.empty()) say(told);
}

}  // namespace

IntegratorOptions run_once(const RunArguments& options, const CatalogueScene& entry, const Session& session,
                           IntegratorOptions chosen, double end, RunResult& result) {
  std::optional<TrajectoryFile> file;
  if (options.adaptive) {
    chosen.step = std::copysign(chosen.step, end - entry.scene->start.time);
    const auto make = [&](const std::shared_ptr<const Scene>& scene) {
      return std::make_unique<AdaptiveIntegrator>(
          scene, session.registry, session.solvers, chosen,
          AdaptiveOptions{.eps = options.eps.value_or(AdaptiveOptions{}.eps),
                          .control = step_control(options.control.value_or(usual_control)),
                          .end = end,
                          .smallest_step = options.smallest_step,
                          .max_steps = options.max_steps.value_or(AdaptiveOptions{}.max_steps)});
    };
    VariableMotion motion(entry.scene, entry.all_rows, entry.events, session.solvers, result.momentum, make);
    const auto side = [&]() -> Integrator {
      return {std::make_shared<const Scene>(motion.scene()), session.registry, session.solvers,
              motion.stepper().options()};
    };
    const std::vector<double> times = chosen_times(options, entry, end);
    require_within(times, entry.scene->start.time, end, motion.stepper().next_size());
    open_trajectory(file, options, entry, std::nullopt);
    TrajectoryFile* const points = file ? &*file : nullptr;
    if (entry.events.empty() && times.empty()) {
      VariableRunChecks checks(motion.stepper(), side());
      run_variable(options, entry, motion.stepper(), checks, end, points, result);
    } else {
      run_variable(options, times, motion, side, end, points, result);
    }
    tell_control(motion.stepper(), result);
    chosen = motion.stepper().options();
  } else {
    const StepGrid grid = fitted_steps(entry, end, chosen.step, options);
    chosen.step = grid.step;
    EventSteps<Integrator> motion(entry.scene, entry.all_rows, entry.events, session.solvers, result.momentum,
                                  integrators(session.registry, session.solvers, chosen));
    run_fixed(options, entry, session, motion, grid.steps, file, result);
    chosen = motion.stepper().options();
  }
  finish_trajectory(file, options, result);
  return chosen;
}

}  // namespace diracstep::command
