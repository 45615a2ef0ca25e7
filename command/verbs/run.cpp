#include <fmt/format.h>

#include <CLI/App.hpp>
#include <cmath>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/kept_invariants.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/command/verbs/run_arguments.hpp>
#include <diracstep/command/verbs/run_steps.hpp>
#include <diracstep/command/verbs/run_times.hpp>
#include <diracstep/core/adaptive/damping_survey.hpp>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/adaptive/error_with_events.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/files/file_lock.hpp>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace diracstep::command {

namespace {

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
  std::vector<double> times = chosen_times(options, entry, end);
  const std::size_t chosen = times.size();
  std::size_t shown = 0;
  const auto show = [&](const Sample& sample) {
    if (file && (chosen == 0 || shown++ < chosen)) file->write(sample);
    result.end = sample;
    return !interrupted();
  };
  times.push_back(end);
  const RunReport again = chosen == 0 ? run_again(entry.scene, session.registry, session.solvers, found,
                                                  result.momentum, options.every, show)
                                      : run_again_at(entry.scene, session.registry, session.solvers, found,
                                                     result.momentum, std::move(times), show);
  result.failure = again.last.failure;
  if (result.failure.empty() && interrupted())
    result.failure = fmt::format("{} at t = {:.10g}", interruption(), result.end.time);
  finish_trajectory(file, options, result);
  return used;
}

/// Throws Misuse for runs that do not look for events, where the scene has some.
void require_events_found(const CatalogueScene& entry, const RunArguments& options) {
  if (entry.events.empty()) return;
  if (options.error && options.adaptive)
    throw Misuse("--error takes fixed steps through the events of the scene: leave --adaptive out");
  if (!options.sensitivities.empty())
    throw Misuse(
        "--sensitivities do not go with the events of the scene: when one is met is not differentiated");
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
  for (const std::string& note : result.notes) say(note);
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
  const bool fixed = step_given || options.fixed || !options.sensitivities.empty() || options.substeps > 1 ||
                     !checkpoint_path(options).empty();
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
  const double end = options.end.value_or(ends_there ? numbers("--at", options.at).back() : entry.t_end);
  if (!options.error && !options.adaptive) {
    take_recommendation(entry, options.method, options.step);
    if (!given.step && options.step)
      options.step = std::copysign(*options.step, end - entry.scene->start.time);
  }
  require_inputs_until(entry, end, "--end");
  require_events_found(entry, options);
  IntegratorOptions used = integrator_options(session, options.method);
  used.step = options.step.value_or(std::copysign(entry.natural_step, end - entry.scene->start.time));
  used.substeps = options.substeps;
  if (options.error) {
    require_within(chosen_times(options, entry, end), entry.scene->start.time, end,
                   std::copysign(entry.natural_step, end - entry.scene->start.time));
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
