#include <fmt/format.h>

#include <CLI/App.hpp>
#include <cmath>
#include <diracstep/core/errors.hpp>
#include <diracstep/core/run.hpp>
#include <diracstep/validation/command/arguments.hpp>
#include <diracstep/validation/command/interrupt.hpp>
#include <diracstep/validation/command/run_control.hpp>
#include <diracstep/validation/command/verbs.hpp>
#include <memory>
#include <optional>

namespace diracstep::command {

namespace {

struct Options {
  std::string scene;
  std::string method = "type1/midpoint";
  int order = 0;
  std::optional<double> step;
  std::optional<double> end;
  std::string momentum = "projected";
  std::string out;
  long every = 1;
  int substeps = 1;
  std::string checkpoint;
  long checkpoint_every = 0;
  std::string resume;
  std::vector<std::string> set;
  bool json = false;
};

StepGrid fitted_steps(const CatalogueScene& entry, double end, const std::optional<double>& wanted) {
  const double start = entry.scene->start.time;
  const double step = wanted.value_or(std::copysign(entry.natural_step, end - start));
  const StepGrid grid = fit_steps(start, end, step);
  if (std::abs(grid.step - step) > 1e-9 * std::abs(step))
    say(fmt::format("step {:g} adjusted to {:.17g}, so that {} steps end at t = {:g}", step, grid.step,
                    grid.steps, end));
  return grid;
}

void require_sense(const Options& options) {
  if (options.every < 1) throw Misuse(fmt::format("--every = {}; 1 or more is needed", options.every));
  if (options.checkpoint_every < 0)
    throw Misuse(
        fmt::format("--checkpoint-every = {}; a number of steps is needed, or 0 for every ten seconds",
                    options.checkpoint_every));
  if (options.checkpoint_every > 0 && options.checkpoint.empty() && options.resume.empty())
    throw Misuse("--checkpoint-every without --checkpoint FILE");
  if (!options.out.empty() && options.out == options.checkpoint)
    throw Misuse(fmt::format("--out and --checkpoint are both '{}'", options.out));
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

void run(const Options& options, Session& session) {
  require_sense(options);
  const CatalogueScene entry = make_scene(options.scene, parameters(options.set));
  Keeping keeping{.momentum = momentum(options.momentum), .every = options.every};
  const StepGrid grid = fitted_steps(entry, options.end.value_or(entry.t_end), options.step);
  Integrator integrator(
      entry.scene, session.registry, session.solvers,
      {.method = options.method, .order = options.order, .step = grid.step, .substeps = options.substeps});
  keeping.checkpoint = options.checkpoint.empty() ? options.resume : options.checkpoint;
  keeping.checkpoint_every = options.checkpoint_every;
  keeping.identity = identity(entry, integrator, keeping, !options.out.empty());
  std::optional<Checkpoint> saved;
  if (!options.resume.empty()) {
    saved = read_checkpoint(options.resume);
    require_same_run(*saved, keeping.identity, options.resume);
    go_on(*saved, options, integrator);
  }
  std::optional<TrajectoryFile> file;
  open_trajectory(file, options, *entry.scene, saved);
  if (file) keeping.file = &*file;

  RunResult result;
  result.momentum = keeping.momentum;
  run_to(grid.steps, integrator, keeping, result);
  if (file) {
    file->close();
    result.out = options.out;
    result.lines = file->lines();
    say(fmt::format("{} points written to {}", result.lines, result.out));
  }
  compare_with_reference(result, entry, integrator.scene());
  if (options.json)
    print(run_json(result, entry, integrator.options()));
  else if (!file)
    print(run_text(result, entry, integrator.options()));
  if (result.failure.empty()) return;
  say(result.failure);
  session.exit_status = failed;
}

}  // namespace

void add_run(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand("run", "One trajectory");
  const auto options = std::make_shared<Options>();
  verb->add_option("SCENE", options->scene, "A scene; see diracstep list scenes")->required();
  verb->add_option("--method", options->method, "A method; see diracstep list methods")
      ->capture_default_str();
  verb->add_option("--order", options->order, "Compose to this order; 0 keeps the method's own")
      ->capture_default_str();
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
  verb->add_option("--set", options->set, "Set a parameter of the scene; may be repeated")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer(
      "Examples:\n"
      "  diracstep run knife_edge --step 0.05 --out knife_edge.csv\n"
      "  diracstep run kepler_e06 --order 8 --end 100 --set e=0.3 --every 10 --out orbit.csv\n"
      "  diracstep run kepler_e06 --end 1e6 --every 1000 --out k.csv --checkpoint k.checkpoint\n"
      "  diracstep run kepler_e06 --end 1e6 --every 1000 --out k.csv --resume k.checkpoint");
  verb->callback([options, &session] { run(*options, session); });
}

}  // namespace diracstep::command
