#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive_integrator.hpp>
#include <diracstep/core/error_control.hpp>
#include <diracstep/core/errors.hpp>
#include <diracstep/core/run.hpp>
#include <diracstep/validation/command/arguments.hpp>
#include <diracstep/validation/command/interrupt.hpp>
#include <diracstep/validation/command/run_report.hpp>
#include <diracstep/validation/command/trajectory_file.hpp>
#include <diracstep/validation/command/verbs.hpp>
#include <diracstep/validation/energy_doubt.hpp>
#include <diracstep/validation/progress.hpp>
#include <memory>
#include <optional>

namespace diracstep::command {

namespace {

struct Options {
  std::string scene;
  std::string method = automatic_method;
  int order = 0;
  std::optional<double> step;
  std::optional<double> end;
  std::string momentum = "projected";
  std::optional<std::string> rule;
  std::string out;
  long every = 1;
  bool adaptive = false;
  double eps = 0.2;
  std::string control = "integrating";
  std::string at;
  std::optional<double> error;
  bool method_given = false;
  std::vector<std::string> set;
  bool json = false;
};

/// Steps to the end, to a failure or to Ctrl-C, and keeps points on the way.
class FixedTrajectory {
 public:
  FixedTrajectory(Integrator& integrator, Momentum momentum, long every, TrajectoryFile* file,
                  RunResult& result)
      : integrator_(integrator),
        momentum_(momentum),
        every_(every),
        file_(file),
        result_(result),
        doubt_(integrator.scene()) {}

  void run(long steps) {
    const long every_look = std::max(1L, steps / points_looked_at);
    keep();
    for (long k = 1; k <= steps && result_.failure.empty() && !interrupted(); ++k) {
      const StepReport report = integrator_.step();
      if (!report.ok())
        result_.failure = report.failure;
      else if (k == steps || (file_ != nullptr && k % every_ == 0))
        keep();
      else if (k % every_look == 0)
        look();
      if (k % steps_between_shows == 0) show(k, steps);
    }
    if (result_.failure.empty() && interrupted() && integrator_.work().steps < steps)
      result_.failure = fmt::format("interrupted at t = {:.17g}", integrator_.time());
    if (integrator_.time() != kept_time_) keep();
    result_.work = integrator_.work();
    result_.doubt = doubt_.text();
  }

 private:
  static constexpr long steps_between_shows = 256;
  static constexpr long points_looked_at = 400;

  void keep() {
    Sample sample;
    const SolveReport report = integrator_.sample(momentum_, sample);
    if (!report.ok()) {
      if (result_.failure.empty())
        result_.failure =
            fmt::format("reading the state at t = {}: {}", integrator_.time(), describe(report.status));
      return;
    }
    kept_time_ = integrator_.time();
    doubt_.see(sample);
    if (file_ != nullptr) file_->write(sample);
    result_.end = std::move(sample);
  }

  /// At the energy only; a point that cannot be read is told of where it is kept.
  void look() {
    if (integrator_.sample(Momentum::projected, looked_at_).ok()) doubt_.see(looked_at_);
  }

  void show(long k, long steps) {
    progress_.show(static_cast<double>(k) / static_cast<double>(steps),
                   fmt::format("step {} of {}", k, steps));
  }

  Integrator& integrator_;
  Momentum momentum_;
  long every_;
  TrajectoryFile* file_;
  RunResult& result_;
  EnergyDoubt doubt_;
  Sample looked_at_;
  double kept_time_ = std::nan("");
  Progress progress_;
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

/// Variable steps to the end, or to the last of the times given.
void run_variable(const Options& options, const CatalogueScene& entry, AdaptiveIntegrator& integrator,
                  double end, TrajectoryFile* file, RunResult& result) {
  Progress progress;
  const double start = entry.scene->start.time;
  const auto keep = [&](const Sample& sample) {
    if (file != nullptr) file->write(sample);
    result.end = sample;
    progress.show((sample.time - start) / (end - start), fmt::format("t = {:g}", sample.time));
    return !interrupted();
  };
  const std::vector<double> times = options.at.empty() ? std::vector<double>{} : numbers("--at", options.at);
  const RunReport report = times.empty()
                               ? diracstep::run(integrator, end, result.momentum, options.every, keep)
                               : run_at(integrator, times, result.momentum, keep);
  result.failure = report.last.failure;
  if (result.failure.empty() && interrupted())
    result.failure = fmt::format("interrupted at t = {:.17g}", integrator.time());
  result.work = integrator.work();
  result.variable =
      VariableSteps{integrator.adaptive().eps, integrator.adaptive().control, integrator.control()};
  const std::string told = warning(*result.variable, result.work.steps);
  if (!told.empty()) say(told);
}

/// One run with the chosen steps into `result`.
IntegratorOptions run_once(const Options& options, const CatalogueScene& entry, const Session& session,
                           IntegratorOptions chosen, double end, RunResult& result) {
  std::optional<TrajectoryFile> file;
  const auto open = [&] {
    if (!options.out.empty()) file.emplace(options.out, *entry.scene);
    return file ? &*file : nullptr;
  };
  if (options.adaptive) {
    chosen.step = std::copysign(chosen.step, end - entry.scene->start.time);
    AdaptiveIntegrator integrator(entry.scene, session.registry, session.solvers, chosen,
                                  {.eps = options.eps, .control = step_control(options.control), .end = end});
    run_variable(options, entry, integrator, end, open(), result);
    chosen = integrator.options();
  } else {
    const StepGrid grid = fitted_steps(entry, end, chosen.step);
    chosen.step = grid.step;
    Integrator integrator(entry.scene, session.registry, session.solvers, chosen);
    FixedTrajectory(integrator, result.momentum, options.every, open(), result).run(grid.steps);
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
  if (options.method_given) wanted.method = options.method;
  wanted.order = options.order;
  if (options.adaptive) wanted.adaptive = true;
  if (options.step)
    wanted.first_step = std::abs(*options.step);
  else if (entry.scene->lagrangian && entry.scene->lagrangian->structure().y_hessian_zero)
    wanted.first_step = std::abs(entry.natural_step);
  wanted.go_on = [] { return !interrupted(); };
  ErrorControlReport found = solve_to_error(entry.scene, session.registry, session.solvers, end, wanted);
  chosen.method = found.method;
  chosen.order = options.order;
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
  const CatalogueScene entry = make_scene(session, options.scene, parameters(options.set));
  RunResult result;
  result.momentum = momentum(options.momentum);
  if (options.every < 1) throw Misuse(fmt::format("--every = {}; 1 or more is needed", options.every));
  if (!options.at.empty() && !options.adaptive) throw Misuse("--at needs --adaptive");
  const double end =
      options.at.empty() ? options.end.value_or(entry.t_end) : numbers("--at", options.at).back();
  IntegratorOptions used{
      .method = options.method,
      .order = options.order,
      .step = options.step.value_or(std::copysign(entry.natural_step, end - entry.scene->start.time)),
      .constraint_rule = rule(session, options.rule)};
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
  verb->add_option(
          "--method", options->method,
          "A method; see diracstep list methods.  auto: GL(S) of the order asked for, or as plan says")
      ->capture_default_str();
  verb->add_option("--order", options->order,
                   "Order; methods of another one are composed to it.  0 keeps the method's own")
      ->capture_default_str();
  verb->add_option("--rule", options->rule,
                   "Rule for nonholonomic rows: left, right, midpoint, trapezoidal or one of a plugin;\n"
                   "the method's own without it");
  verb->add_option("--step", options->step, "Step size; the scene's own without it");
  verb->add_option("--end", options->end, "End time; the scene's own without it");
  verb->add_option("--momentum", options->momentum,
                   "Representative of the momentum: plus, minus or projected")
      ->capture_default_str();
  verb->add_option("--out", options->out, "CSV file for the trajectory")->type_name("FILE");
  verb->add_option("--every", options->every, "Keep each K-th point")->type_name("K")->capture_default_str();
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
  verb->add_option("--set", options->set, "Set a parameter of the scene; may be repeated")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer(
      "Examples:\n"
      "  diracstep run knife_edge --step 0.05 --out knife_edge.csv\n"
      "  diracstep run kepler_e099 --method type1/gl:4 --adaptive --out comet.csv\n"
      "  diracstep run pendulum_cartesian --error 1e-8\n"
      "  diracstep run kepler_e06 --order 8 --end 100 --set e=0.3 --every 10 --out orbit.csv");
  verb->callback([options, verb, &session] {
    options->method_given = verb->count("--method") > 0;
    run(*options, session);
  });
}

}  // namespace diracstep::command
