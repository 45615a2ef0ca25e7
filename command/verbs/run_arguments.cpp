#include <fmt/format.h>

#include <cmath>
#include <diracstep/command/files/trajectory_file.hpp>
#include <diracstep/command/verbs/run_arguments.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/paths.hpp>

namespace diracstep::command {

namespace {

constexpr double most_seconds = 1e8;  // three years

void require_limits(const RunArguments& options) {
  if (options.max_solves && *options.max_solves < 1)
    throw Misuse(fmt::format("--max-solves = {}; 1 or more is needed", *options.max_solves));
  if (options.max_steps && *options.max_steps < 1)
    throw Misuse(fmt::format("--max-steps = {}; 1 or more is needed", *options.max_steps));
  if (options.max_steps && options.error)
    throw Misuse("--max-steps does not go with --error: the work of its search is limited by --max-solves");
  if (options.max_time && !(*options.max_time > 0.0 && *options.max_time <= most_seconds))
    throw Misuse(fmt::format("--max-time = {:g}; a number of seconds above 0, up to {:g}, is needed",
                             *options.max_time, most_seconds));
  if (!(options.smallest_step >= 0.0) ||
      (options.smallest_step > 0.0 && (!options.adaptive || options.error)))
    throw Misuse(fmt::format("--smallest-step = {:g}; 0 or more is needed, and --adaptive without --error",
                             options.smallest_step));
}

/// An option that nothing would read is a mistake.
void require_use(const RunArguments& options) {
  const bool variable = options.adaptive && !options.error;
  if (options.eps && !variable)
    throw Misuse("--eps needs --adaptive without --error: it is the size of variable steps");
  if (options.control && !options.adaptive && !options.error) throw Misuse("--control needs --adaptive");
  if (options.control && options.fixed) throw Misuse("--control and --fixed exclude each other");
  if (options.max_solves && !options.error)
    throw Misuse("--max-solves needs --error: --max-steps limits other runs");
  if (options.fixed && !options.error)
    throw Misuse("--fixed needs --error: without it steps are of fixed size unless --adaptive is given");
}

}  // namespace

void add_run_arguments(CLI::App& verb, Session& session, RunArguments& options) {
  add_solver_options(verb, session);
  verb.add_option("SCENE", options.scene, "A scene; see diracstep list scenes")->required();
  add_method_options(verb, options.method);
  verb.add_option("--step", options.step, "Step size; the scene's own without it");
  verb.add_option("--end", options.end, "End time; the scene's own without it");
  verb.add_option("--momentum", options.momentum, "Representative of the momentum: plus, minus or projected")
      ->capture_default_str();
  verb.add_option("--out", options.out, "CSV file for the trajectory; - is standard output")
      ->type_name("FILE");
  verb.add_option("--every", options.every, "Keep each K-th point")->type_name("K")->capture_default_str();
  verb.add_option("--substeps", options.substeps,
                  "Take a step that cannot be solved in 2, 4, … up to N smaller ones")
      ->type_name("N")
      ->capture_default_str();
  verb.add_option("--checkpoint", options.checkpoint, "Keep all that is needed to go on in this file")
      ->type_name("FILE");
  verb.add_option("--checkpoint-every", options.checkpoint_every,
                  "Write it at each K-th step; without, every ten seconds and at the end")
      ->type_name("K");
  verb.add_option("--resume", options.resume,
                  "Go on from a checkpoint, with the same bits as if never interrupted")
      ->type_name("FILE");
  verb.add_option("--max-steps", options.max_steps,
                  "Refuse a run of more steps; with --adaptive it fails at the next one")
      ->type_name("N");
  verb.add_option("--max-time", options.max_time,
                  "End the run after so many seconds, as an interrupt does: with its checkpoint;\n"
                  "with --error the whole search, which then shows its best answer (30 without)")
      ->type_name("S");
  verb.add_flag("--adaptive", options.adaptive,
                "Steps of varying size: reversible ones, or by their local error with damped/radau:S");
  verb.add_option("--eps", options.eps,
                  "With --adaptive: radians of a step of varying size, 0.2 without; or its local error,\n"
                  "1e-6 without");
  verb.add_option("--control", options.control,
                  "How its size is found: integrating (without), in-step, or irreversible (for comparison);\n"
                  "for damped/radau:S always local-error");
  verb.add_option("--at", options.at,
                  "Times T1,T2,… to show instead of the steps, each by a step of the method from the last\n"
                  "node, and behind an event at its time; the motion keeps its bits.  With --adaptive and\n"
                  "without --end the last of them ends the run")
      ->type_name("T1,T2,…");
  verb.add_option("--sensitivities", options.sensitivities,
                  "Exact derivatives of the motion by parameters of the scene and by q0, v0, p0, its start:\n"
                  "of the end in the summary, of each point in the file")
      ->type_name("P,q0,…");
  verb.add_option("--every-time", options.every_time, "The same at the start and after every so much time")
      ->type_name("T");
  verb.add_option(
          "--error", options.error,
          "Relative error at the end; the library chooses method and step,\nand repeats the run until its "
          "estimate is below")
      ->type_name("E");
  add_redundancy_option(verb, session);
  verb.add_flag("--fixed", options.fixed,
                "With --error: steps of fixed size, also where variable ones are cheaper");
  verb.add_option("--max-solves", options.max_solves,
                  "With --error: nonlinear systems, of each kind of steps tried; the best answer so far is "
                  "then shown (1000000 without)")
      ->type_name("N");
  verb.add_option("--smallest-step", options.smallest_step,
                  "With --adaptive: steps do not become smaller; 0: 1e-9 of the motion")
      ->type_name("H")
      ->capture_default_str();
  verb.add_option("--doubt", options.doubt,
                  "A run whose result is doubted exits with status 3 (report), or with 0 (ignore)")
      ->type_name("WHAT")
      ->capture_default_str();
  add_set_option(verb, options.set);
  add_tolerance_option(verb, session);
  verb.add_flag("--json", options.json, "One JSON document on standard output");
}

std::string checkpoint_path(const RunArguments& options) {
  return options.checkpoint.empty() ? options.resume : options.checkpoint;
}

void require_sense(const RunArguments& options) {
  const bool checkpoints = !options.checkpoint.empty() || !options.resume.empty();
  if (options.every < 1) throw Misuse(fmt::format("--every = {}; 1 or more is needed", options.every));
  const bool chosen_times = !options.at.empty() || options.every_time;
  if (!options.at.empty() && options.every_time) throw Misuse("--at and --every-time exclude each other");
  if (options.every_time && !(*options.every_time > 0.0 && std::isfinite(*options.every_time)))
    throw Misuse(fmt::format("--every-time = {}; a number above 0 is needed", *options.every_time));
  if (chosen_times && options.every != 1)
    throw Misuse("--every counts steps; it does not go with --at and --every-time");
  if (options.eps && std::isnan(*options.eps)) throw Misuse("--eps is not a number");
  if (!options.sensitivities.empty() && (options.adaptive || options.error || chosen_times || checkpoints))
    throw Misuse(
        "--sensitivities are those of fixed steps to the end: --adaptive, --error, --at, --every-time, "
        "--checkpoint and --resume exclude them");
  if (options.fixed && options.adaptive) throw Misuse("--fixed and --adaptive exclude each other");
  require_limits(options);
  require_use(options);
  if (options.out == standard_output && (options.json || checkpoints))
    throw Misuse("--out - gives standard output to the points: --json, --checkpoint and --resume exclude it");
  if (options.doubt != "report" && options.doubt != "ignore")
    throw Misuse(fmt::format("--doubt: '{}' is not one of report, ignore", options.doubt));
  if (options.checkpoint_every < 0)
    throw Misuse(
        fmt::format("--checkpoint-every = {}; a number of steps is needed, or 0 for every ten seconds",
                    options.checkpoint_every));
  if (options.checkpoint_every > 0 && !checkpoints)
    throw Misuse("--checkpoint-every without --checkpoint FILE");
  if (checkpoints && options.adaptive)
    throw Misuse("--checkpoint and --resume do not go with --adaptive: checkpoints cover fixed steps only");
  if (checkpoints && options.error)
    throw Misuse("--checkpoint and --resume do not go with --error: name the method and the step instead");
}

void require_files(const RunArguments& options, const Session& session) {
  std::vector<NamedPath> outputs;
  if (!options.out.empty() && options.out != standard_output) outputs.push_back({"--out", options.out});
  if (const std::string checkpoint = checkpoint_path(options); !checkpoint.empty())
    outputs.push_back({options.checkpoint.empty() ? "--resume" : "--checkpoint", checkpoint});
  if (!options.resume.empty() && !options.out.empty() && same_file(options.resume, options.out))
    throw Misuse(fmt::format("--out and --resume are both '{}'", options.resume));
  require_outputs(outputs, inputs_of({options.scene}, session));
}

}  // namespace diracstep::command
