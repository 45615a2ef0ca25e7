#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/progress.hpp>
#include <diracstep/command/run_control.hpp>
#include <diracstep/command/run_identity.hpp>
#include <diracstep/command/verbs/verbs.hpp>
#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/energy_check.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/files/file_lock.hpp>
#include <diracstep/files/paths.hpp>
#include <memory>
#include <optional>

namespace diracstep::command {

namespace {

constexpr double most_seconds = 1e8;  // three years

struct Options {
  std::string scene;
  MethodChoice method;
  std::optional<double> step;
  std::optional<double> end;
  std::string momentum = "projected";
  std::string out;
  long every = 1;
  int substeps = 1;
  std::string checkpoint;
  long checkpoint_every = 0;
  std::string resume;
  double max_steps = 1e12, min_step = 0.0;
  std::optional<double> max_seconds;
  bool adaptive = false;
  double eps = 0.2;
  std::string control = "integrating";
  std::string at;
  std::optional<double> error;
  std::vector<std::string> set;
  bool json = false;
};

StepGrid fitted_steps(const CatalogueScene& entry, double end, double step, double max_steps) {
  const StepGrid grid = fit_steps(entry.scene->start.time, end, step);
  if (static_cast<double>(grid.steps) > max_steps)
    throw Misuse(fmt::format("{} steps of {:g} lead to t = {:g}; --max-steps allows {:g}", grid.steps,
                             grid.step, end, max_steps));
  if (std::abs(grid.step - step) > 1e-9 * std::abs(step))
    say(fmt::format("step {:g} adjusted to {:.17g}, so that {} steps end at t = {:g}", step, grid.step,
                    grid.steps, end));
  return grid;
}

void require_sense(const Options& options) {
  const bool checkpoints = !options.checkpoint.empty() || !options.resume.empty();
  if (options.every < 1) throw Misuse(fmt::format("--every = {}; 1 or more is needed", options.every));
  if (!options.at.empty() && !options.adaptive) throw Misuse("--at needs --adaptive");
  if (options.checkpoint_every < 0)
    throw Misuse(
        fmt::format("--checkpoint-every = {}; a number of steps is needed, or 0 for every ten seconds",
                    options.checkpoint_every));
  if (options.checkpoint_every > 0 && !checkpoints)
    throw Misuse("--checkpoint-every without --checkpoint FILE");
  if (!(options.max_steps >= 1.0))
    throw Misuse(fmt::format("--max-steps = {:g}; 1 or more is needed", options.max_steps));
  if (!(options.min_step >= 0.0) || (options.min_step > 0.0 && !options.adaptive))
    throw Misuse(
        fmt::format("--min-step = {:g}; a number of at least 0 is needed, and --adaptive", options.min_step));
  if (options.max_seconds && !(*options.max_seconds > 0.0 && *options.max_seconds <= most_seconds))
    throw Misuse(fmt::format("--max-seconds = {:g}; a number above 0, up to {:g}, is needed",
                             *options.max_seconds, most_seconds));
  if (checkpoints && options.adaptive)
    throw Misuse("--checkpoint and --resume do not go with --adaptive: checkpoints cover fixed steps only");
  if (checkpoints && options.error)
    throw Misuse("--checkpoint and --resume do not go with --error: name the method and the step instead");
}

/// The file that checkpoints go to, or empty.
std::string checkpoint_path(const Options& options) {
  return options.checkpoint.empty() ? options.resume : options.checkpoint;
}

/// Before anything is computed: what could not be written in the end, or would be written over something
/// read.
void require_files(const Options& options, const Session& session) {
  std::vector<NamedPath> inputs, outputs;
  if (options.scene.ends_with(".toml")) inputs.push_back({"the scene", options.scene});
  for (const Plugin& plugin : session.plugins) inputs.push_back({"the plugin", plugin.path()});
  if (!options.out.empty()) outputs.push_back({"--out", options.out});
  if (const std::string checkpoint = checkpoint_path(options); !checkpoint.empty())
    outputs.push_back({options.checkpoint.empty() ? "--resume" : "--checkpoint", checkpoint});
  if (!options.resume.empty() && !options.out.empty() && same_file(options.resume, options.out))
    throw Misuse(fmt::format("--out and --resume are both '{}'", options.resume));
  require_outputs(outputs, inputs);
}

/// Where the file goes on: from the checkpoint, or from its beginning.
void open_trajectory(std::optional<TrajectoryFile>& file, const Options& options, const Scene& scene,
                     const std::optional<Checkpoint>& saved) {
  if (options.out.empty()) return;
  if (saved)
    file.emplace(options.out, scene, TrajectoryFile::Mark{saved->points, saved->bytes});
  else
    file.emplace(options.out, scene);
}

void go_on(const Checkpoint& saved, const Options& options, Integrator& integrator) {
  try {
    integrator.restore(saved.state);
  } catch (const Misuse& misuse) {
    throw Misuse(fmt::format("--resume: '{}': {}", options.resume, misuse.what()));
  }
  say(fmt::format("going on from step {}, t = {:g}", integrator.work().steps, integrator.time()));
}

/// Steps of one size to the end, from the start or from a checkpoint.
void run_fixed(const Options& options, const CatalogueScene& entry, const Session& session,
               Integrator& integrator, long steps, std::optional<TrajectoryFile>& file, RunResult& result) {
  Keeping keeping{.momentum = result.momentum, .every = options.every};
  keeping.checkpoint = checkpoint_path(options);
  keeping.checkpoint_every = options.checkpoint_every;
  keeping.identity = run_identity(entry, session, options.method, integrator, keeping, !options.out.empty());
  std::optional<Checkpoint> saved;
  if (!options.resume.empty()) {
    saved = read_checkpoint(options.resume);
    require_same_run(*saved, keeping.identity, options.resume);
    go_on(*saved, options, integrator);
  }
  open_trajectory(file, options, *entry.scene, saved);
  if (file) keeping.file = &*file;
  run_to(steps, integrator, keeping, result);
}

/// Variable steps to the end, or to the last of the times given.
void run_variable(const Options& options, const CatalogueScene& entry, AdaptiveIntegrator& integrator,
                  double end, TrajectoryFile* file, RunResult& result) {
  Progress progress;
  const double start = entry.scene->start.time;
  const auto scene = completed(entry.scene);
  EnergyCheck doubt(*scene);
  std::string beyond;  // a limit
  const auto keep = [&](const Sample& sample) {
    if (integrator.control().smallest_step < options.min_step)
      beyond = fmt::format("a step of {:g} is below --min-step", integrator.control().smallest_step);
    if (static_cast<double>(integrator.work().steps) > options.max_steps)
      beyond = fmt::format("--max-steps allows {:g}", options.max_steps);
    doubt.see(sample);
    if (file != nullptr) file->write(sample);
    result.end = sample;
    progress.show((sample.time - start) / (end - start), fmt::format("t = {:g}", sample.time));
    return beyond.empty() && !interrupted();
  };
  const std::vector<double> times = options.at.empty() ? std::vector<double>{} : numbers("--at", options.at);
  const RunReport report = times.empty()
                               ? diracstep::run(integrator, end, result.momentum, options.every, keep)
                               : run_at(integrator, times, result.momentum, keep);
  result.failure = report.last.failure;
  if (result.failure.empty() && !beyond.empty())
    result.failure = fmt::format("stopped at t = {:.17g}: {}", integrator.time(), beyond);
  else if (result.failure.empty() && interrupted())
    result.failure = fmt::format("{} at t = {:.17g}", interruption(), integrator.time());
  result.work = integrator.work();
  result.doubt = doubt.text();
  result.variable =
      VariableSteps{integrator.adaptive().eps, integrator.adaptive().control, integrator.control()};
  const std::string told = warning(*result.variable, result.work.steps);
  if (!told.empty()) say(told);
}

/// One run with the chosen steps into `result`.
IntegratorOptions run_once(const Options& options, const CatalogueScene& entry, const Session& session,
                           IntegratorOptions chosen, double end, RunResult& result) {
  std::optional<TrajectoryFile> file;
  if (options.adaptive) {
    chosen.step = std::copysign(chosen.step, end - entry.scene->start.time);
    AdaptiveIntegrator integrator(entry.scene, session.registry, session.solvers, chosen,
                                  {.eps = options.eps, .control = step_control(options.control), .end = end});
    open_trajectory(file, options, *entry.scene, std::nullopt);
    run_variable(options, entry, integrator, end, file ? &*file : nullptr, result);
    chosen = integrator.options();
  } else {
    const StepGrid grid = fitted_steps(entry, end, chosen.step, options.max_steps);
    chosen.step = grid.step;
    Integrator integrator(entry.scene, session.registry, session.solvers, chosen);
    run_fixed(options, entry, session, integrator, grid.steps, file, result);
    chosen = integrator.options();
  }
  if (file) {
    file->close();
    result.out = options.out;
    result.lines = file->lines();
    say(fmt::format("{} points written to {}", result.lines, result.out));
  }
  return chosen;
}

/// Finds the steps for --error; what was found is in the options afterwards.
ErrorControlReport search(Options& options, const CatalogueScene& entry, const Session& session, double end,
                          IntegratorOptions& chosen) {
  ErrorControlOptions wanted{.error = *options.error};
  if (options.method.given) wanted.method = options.method.name;
  wanted.order = options.method.order;
  if (options.adaptive) wanted.adaptive = true;
  if (options.step)
    wanted.first_step = std::abs(*options.step);
  else if (entry.scene->lagrangian && entry.scene->lagrangian->structure().y_hessian_zero)
    wanted.first_step = std::abs(entry.natural_step);
  wanted.go_on = [] { return !interrupted(); };
  ErrorControlReport found = solve_to_error(entry.scene, session.registry, session.solvers, end, wanted);
  chosen.method = found.method;
  chosen.order = options.method.order;
  chosen.compensated_sums = found.compensated_sums;
  options.adaptive = found.adaptive;
  if (found.adaptive)
    options.eps = found.step;
  else
    chosen.step = found.step;
  return found;
}

void report(const RunResult& result, const Options& options, const CatalogueScene& entry,
            const IntegratorOptions& used, Session& session) {
  if (options.json)
    print(run_json(result, entry, used));
  else if (result.out.empty())
    print(run_text(result, entry, used));
  if (!result.doubt.empty()) say(result.doubt);
  if (result.failure.empty()) return;
  say(result.failure);
  session.exit_status = failed;
}

void run(const Options& given, Session& session) {
  Options options = given;
  require_sense(options);
  require_files(options, session);
  std::optional<FileLock> lock;
  if (const std::string checkpoint = checkpoint_path(options); !checkpoint.empty()) lock.emplace(checkpoint);
  const CatalogueScene entry = make_scene(session, options.scene, parameters(options.set));
  catch_interrupts();
  if (options.max_seconds) limit_time(*options.max_seconds);
  RunResult result;
  result.momentum = momentum(options.momentum);
  const double end =
      options.at.empty() ? options.end.value_or(entry.t_end) : numbers("--at", options.at).back();
  IntegratorOptions used = integrator_options(session, options.method);
  used.step = options.step.value_or(std::copysign(entry.natural_step, end - entry.scene->start.time));
  used.substeps = options.substeps;
  if (options.error) {
    result.search = search(options, entry, session, end, used);
    if (!result.search->warning.empty()) say(result.search->warning);
  }
  const bool once_more = result.search && result.search->ok() &&
                         (!options.out.empty() || result.momentum != Momentum::projected);
  if (!result.search || once_more) {
    used = run_once(options, entry, session, used, end, result);
  } else {
    result.failure = result.search->refusal;
    result.end = result.search->end;
    result.work = result.search->work;
    result.work.steps = result.search->runs.back().steps;
    used.order = result.search->order;
  }
  compare_with_reference(result, entry, *completed(entry.scene));
  report(result, options, entry, used, session);
}

}  // namespace

void add_run(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand("run", "One trajectory");
  add_solver_options(*verb, session);
  const auto options = std::make_shared<Options>();
  verb->add_option("SCENE", options->scene, "A scene; see diracstep list scenes")->required();
  add_method_options(*verb, options->method);
  verb->add_option("--step", options->step, "Step size; the scene's own without it");
  verb->add_option("--end", options->end, "End time; the scene's own without it");
  verb->add_option("--momentum", options->momentum,
                   "Representative of the momentum: plus, minus or projected")
      ->capture_default_str();
  verb->add_option("--out", options->out, "CSV file for the trajectory")->type_name("FILE");
  verb->add_option("--every", options->every, "Keep each K-th point")->type_name("K")->capture_default_str();
  verb->add_option("--substeps", options->substeps,
                   "Take a step that cannot be solved in 2, 4, … up to N smaller ones")
      ->type_name("N")
      ->capture_default_str();
  verb->add_option("--checkpoint", options->checkpoint, "Keep all that is needed to go on in this file")
      ->type_name("FILE");
  verb->add_option("--checkpoint-every", options->checkpoint_every,
                   "Write it at each K-th step; without, every ten seconds and at the end")
      ->type_name("K");
  verb->add_option("--resume", options->resume,
                   "Go on from a checkpoint, with the same bits as if never interrupted")
      ->type_name("FILE");
  verb->add_option("--max-steps", options->max_steps, "Refuse a run of more steps")
      ->type_name("N")
      ->capture_default_str();
  verb->add_option("--min-step", options->min_step, "End a run of varying steps where one gets smaller")
      ->type_name("H")
      ->capture_default_str();
  verb->add_option("--max-seconds", options->max_seconds,
                   "End the run after so long, as an interrupt does: with its checkpoint")
      ->type_name("S");
  verb->add_flag("--adaptive", options->adaptive, "Reversible steps of varying size");
  verb->add_option("--eps", options->eps, "Radians of a step of varying size")->capture_default_str();
  verb->add_option("--control", options->control,
                   "How its size is found: integrating, in-step, or irreversible (for comparison)")
      ->capture_default_str();
  verb->add_option("--at", options->at, "Times T1,T2,… to show instead of the steps; needs --adaptive");
  verb->add_option(
          "--error", options->error,
          "Relative error at the end; the library chooses method and step,\nand repeats the run until its "
          "estimate is below")
      ->type_name("E");
  add_set_option(*verb, options->set);
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer(
      "Examples:\n"
      "  diracstep run knife_edge --step 0.05 --out knife_edge.csv\n"
      "  diracstep run kepler_e099 --method type1/gl:4 --adaptive --out comet.csv\n"
      "  diracstep run pendulum_cartesian --error 1e-8\n"
      "  diracstep run kepler_e06 --order 8 --end 100 --set e=0.3 --every 10 --out orbit.csv\n"
      "  diracstep run kepler_e06 --end 1e6 --every 1000 --out k.csv --checkpoint k.checkpoint\n"
      "  diracstep run kepler_e06 --end 1e6 --every 1000 --out k.csv --resume k.checkpoint");
  verb->callback([options, &session] { run(*options, session); });
}

}  // namespace diracstep::command
