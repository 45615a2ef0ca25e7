#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/kept_invariants.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/run_control.hpp>
#include <diracstep/command/run_identity.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/command/verbs/run_arguments.hpp>
#include <diracstep/command/verbs/run_times.hpp>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/adaptive/checked_motion.hpp>
#include <diracstep/core/adaptive/damping_survey.hpp>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/adaptive/error_with_events.hpp>
#include <diracstep/core/adaptive/rate_monitor.hpp>
#include <diracstep/core/adaptive/variable_run_checks.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/event_steps.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/files/file_lock.hpp>
#include <memory>
#include <optional>

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

/// Where the file goes on: from the checkpoint, or from its beginning.
void open_trajectory(std::optional<TrajectoryFile>& file, const RunArguments& options,
                     const CatalogueScene& entry, const std::optional<Checkpoint>& saved,
                     const std::vector<Output>& sensitivities = {}) {
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
  keeping.times = chosen_times(
      options, entry, entry.scene->start.time + static_cast<double>(steps) * integrator.options().step);
  require_within(keeping.times, integrator, steps);
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

/// Variable steps to the end, or to the last of the times given.
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
  const std::vector<double> times = chosen_times(options, entry, end);
  const RunReport report = times.empty()
                               ? run_until(integrator, end, result.momentum, options.every, keep, &checks)
                               : run_at(integrator, times, result.momentum, keep, &checks);
  result.failure = report.last.failure;
  if (result.failure.empty() && interrupted())
    result.failure = fmt::format("{} at t = {:.10g}", interruption(), integrator.time());
  result.work = integrator.work();
  result.doubt = checks.text();
}

using VariableMotion = EventSteps<AdaptiveIntegrator>;

/// Variable steps through the events of a scene, to the end.
void run_variable(const RunArguments& options, VariableMotion& motion,
                  const std::function<Integrator()>& side, double end, TrajectoryFile* file,
                  RunResult& result) {
  CheckedMotion<AdaptiveIntegrator> checked(motion,
                                            [&] { return VariableRunChecks(motion.stepper(), side()); });
  const auto keep = [&](const Sample& sample) {
    if (file != nullptr) file->write(sample);
    result.end = sample;
    return true;
  };
  result.failure = run_through_events(checked, {.end = end, .every = options.every}, keep, [] {
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

void finish(std::optional<TrajectoryFile>& file, const RunArguments& options, RunResult& result) {
  if (!file) return;
  file->close();
  result.out = options.out == standard_output ? "standard output" : options.out;
  result.lines = file->lines();
  say(fmt::format("{} points written to {}", result.lines, result.out));
}

/// One run with the chosen steps into `result`.
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
    open_trajectory(file, options, entry, std::nullopt);
    TrajectoryFile* const points = file ? &*file : nullptr;
    if (entry.events.empty()) {
      VariableRunChecks checks(motion.stepper(), side());
      run_variable(options, entry, motion.stepper(), checks, end, points, result);
    } else {
      run_variable(options, motion, side, end, points, result);
    }
    tell_control(motion.stepper(), result);
    chosen = motion.stepper().options();
  } else {
    const StepGrid grid = fitted_steps(entry, end, chosen.step, options);
    chosen.step = grid.step;
    const auto make = [&](const std::shared_ptr<const Scene>& scene) {
      return std::make_unique<Integrator>(scene, session.registry, session.solvers, chosen);
    };
    EventSteps<Integrator> motion(entry.scene, entry.all_rows, entry.events, session.solvers, result.momentum,
                                  make);
    run_fixed(options, entry, session, motion, grid.steps, file, result);
    chosen = motion.stepper().options();
  }
  finish(file, options, result);
  return chosen;
}

/// Finds the steps for --error.
ErrorControlReport search(const RunArguments& options, const CatalogueScene& entry, const Session& session,
                          double end, const IntegratorOptions& chosen) {
  ErrorControlOptions wanted;
  wanted.error = *options.error;
  wanted.method = options.method.name;
  wanted.order = options.method.order;
  if (options.adaptive || options.fixed) wanted.adaptive = options.adaptive;
  wanted.control = step_control(options.control.value_or(usual_control));
  if (options.step)
    wanted.first_step = std::abs(*options.step);
  else if (!has_accelerations(*completed(entry.scene)))
    wanted.first_step = std::abs(entry.natural_step);
  wanted.integrator = chosen;
  wanted.max_solves = options.max_solves.value_or(wanted.max_solves);
  wanted.max_time = options.max_time.value_or(wanted.max_time);
  wanted.go_on = [] { return !interrupted(); };
  if (!entry.events.empty()) {
    if (!options.step) wanted.first_step = std::abs(entry.natural_step);
    return solve_events_to_error(entry.scene, entry.all_rows, entry.events, session.registry, session.solvers,
                                 end, wanted);
  }
  return solve_to_error(entry.scene, session.registry, session.solvers, end, wanted);
}

/// The run that the search ended with: its end, and again point by point where a file or another momentum is
/// asked for.
IntegratorOptions take_found(const RunArguments& options, const CatalogueScene& entry, const Session& session,
                             double end, RunResult& result) {
  const ErrorControlReport& found = *result.search;
  result.failure = found.refusal;
  if (const std::string ended = "interrupted"; interrupted() && result.failure.ends_with(ended))
    result.failure.replace(result.failure.size() - ended.size(), ended.size(), interruption());
  result.doubt = found.warning;
  result.end = found.end;
  result.work = found.work;
  result.work.steps = 0;
  for (const ErrorControlRun& run : found.runs)
    if (run.failure.empty()) result.work.steps = run.steps;
  IntegratorOptions used = found.steps.integrator;
  used.method = found.method;
  used.order = found.order;
  used.step = found.step;
  if (found.ok() && !entry.events.empty()) return run_once(options, entry, session, used, end, result);
  if (!found.ok() || (options.out.empty() && result.momentum == Momentum::projected)) return used;
  std::optional<TrajectoryFile> file;
  open_trajectory(file, options, entry, std::nullopt);
  const RunReport again = run_again(entry.scene, session.registry, session.solvers, found, result.momentum,
                                    options.every, [&](const Sample& sample) {
                                      if (file) file->write(sample);
                                      result.end = sample;
                                      return !interrupted();
                                    });
  result.failure = again.last.failure;
  if (result.failure.empty() && interrupted())
    result.failure = fmt::format("{} at t = {:.10g}", interruption(), result.end.time);
  finish(file, options, result);
  return used;
}

/// Throws Misuse for runs that do not look for events, where the scene has some.
void require_events_found(const CatalogueScene& entry, const RunArguments& options) {
  if (entry.events.empty()) return;
  if (options.error && options.adaptive)
    throw Misuse("--error takes fixed steps through the events of the scene: leave --adaptive out");
  const bool times = !options.at.empty() || options.every_time,
             ends = std::ranges::any_of(entry.events, [](const Event&e) { return e.stop || e.acts(); });
  if (times && (options.adaptive || ends))
    throw Misuse(
        "--at and --every-time go with fixed steps and with events that neither stop the run nor change its "
        "motion; --every N shows each N-th step");
}

void take_outputs(const CatalogueScene& entry, RunResult& result) {
  if (!result.has_end()) return;
  result.end.lambda = shown_forces(entry, result.end.time, result.end.q, result.end.lambda);
  for (const Output& output : entry.outputs)
    result.outputs.emplace_back(output.name, output.at(result.end.point()));
  for (const auto& [name, value] : result.outputs)
    if (!std::isfinite(value))
      result.doubt =
          joined_doubts({result.doubt, fmt::format("the output '{}' is not a finite number at t = {:g}", name,
                                                   result.end.time)});
}

void report(const RunResult& result, const RunArguments& options, const CatalogueScene& entry,
            const IntegratorOptions& used, Session& session) {
  if (options.out == standard_output)  // which belongs to the points
    say("the run whose points went to standard output:\n" + run_text(result, entry, used));
  else if (options.json || result.out.empty() || output_is_open())  // with a file the summary is an extra
    print(options.json ? run_json(result, entry, used) : run_text(result, entry, used));
  if (!result.doubt.empty()) say(result.doubt);
  if (!result.doubt.empty() && options.doubt == "report") session.exit_status = doubted;
  if (result.failure.empty()) return;
  say(result.failure);
  session.exit_status = failed;
}

/// The method where none is named, for the motion at hand.  Strong damping takes steps of varying size, where
/// none is asked for and nothing else needs fixed ones.
void choose_method(RunArguments& options, const CatalogueScene& entry, const Session& session, double end,
                   bool step_given, IntegratorOptions& used) {
  if (used.method != automatic_method) return;
  const DefaultMethod choice =
      default_method_of_motion(entry.scene, session.registry, session.solvers, end, std::abs(used.step), used,
                               {used.order, 0.0, used.constraint_rule, large_from(used.dense_limit)});
  if (!session.registry.method(choice.method).info.damped) return;
  used.method = choice.method;
  const bool times_with_events = !entry.events.empty() && (!options.at.empty() || options.every_time);
  const bool fixed = step_given || options.fixed || !options.sensitivities.empty() || options.substeps > 1 ||
                     times_with_events || !checkpoint_path(options).empty();
  if (!fixed) options.adaptive = true;
  if (!fixed && !options.eps) options.eps = choice.local_error;
  say(fmt::format("{}; {}{}", choice.method, choice.reason,
                  fixed ? "" : "; steps vary by their local error, --step H takes fixed ones"));
}

void run(const RunArguments& given, Session& session) {
  RunArguments options = given;
  require_sense(options);
  require_files(options, session);
  std::optional<FileLock> lock;
  if (const std::string checkpoint = checkpoint_path(options); !checkpoint.empty()) lock.emplace(checkpoint);
  const CatalogueScene entry = make_scene(session, options.scene, parameters(options.set));
  catch_interrupts();
  // The search of --error looks at the clock itself and ends with its best answer: it is to come first.
  if (options.max_time) limit_time(*options.max_time + (options.error ? grace_seconds : 0.0));
  RunResult result;
  result.momentum = momentum(options.momentum);
  const bool ends_there = options.adaptive && !options.at.empty();
  const double end = ends_there ? numbers("--at", options.at).back() : options.end.value_or(entry.t_end);
  if (!options.error && !options.adaptive) {
    take_recommendation(entry, options.method, options.step);
    if (!given.step && options.step)
      options.step = std::copysign(*options.step, end - entry.scene->start.time);
  }
  require_inputs_until(entry, end, "--end");
  require_events_found(entry, options);
  if (!options.sensitivities.empty() && !entry.events.empty())
    throw Misuse(
        "--sensitivities do not go with the events of the scene: when one is met is not differentiated");
  IntegratorOptions used = integrator_options(session, options.method);
  used.step = options.step.value_or(std::copysign(entry.natural_step, end - entry.scene->start.time));
  used.substeps = options.substeps;
  if (options.error) {
    result.search = search(options, entry, session, end, used);
    used = take_found(options, entry, session, end, result);
  } else {
    choose_method(options, entry, session, end, given.step.has_value(), used);
    used = run_once(options, entry, session, used, end, result);
  }
  compare_with_reference(result, entry, *completed(entry.scene));
  compare_invariants(entry, options.set.empty(), options.error, result);
  take_outputs(entry, result);
  report(result, options, entry, used, session);
}

}  // namespace

void add_run(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand("run", "One trajectory");
  const auto options = std::make_shared<RunArguments>();
  add_run_arguments(*verb, session, *options);
  verb->footer(
      "Examples:\n"
      "  diracstep run knife_edge --step 0.05 --out knife_edge.csv\n"
      "  diracstep run kepler_e099 --method type1/gl:4 --adaptive --out comet.csv\n"
      "  diracstep run pendulum_cartesian --error 1e-8\n"
      "  diracstep run chaplygin_sleigh --sensitivities m,a,q0\n"
      "  diracstep run kepler_e06 --order 8 --end 100 --set e=0.3 --every 10 --out orbit.csv\n"
      "  diracstep run kepler_e06 --end 1e6 --every 1000 --out k.csv --checkpoint k.checkpoint\n"
      "  diracstep run kepler_e06 --end 1e6 --every 1000 --out k.csv --resume k.checkpoint");
  verb->callback([options, &session] { run(*options, session); });
}

}  // namespace diracstep::command
