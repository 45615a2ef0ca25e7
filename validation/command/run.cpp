#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
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
  std::vector<std::string> set;
  bool json = false;
};

/// Steps to the end, to a failure or to Ctrl-C, and keeps points on the way.
class Trajectory {
 public:
  Trajectory(Integrator& integrator, Momentum momentum, long every, TrajectoryFile* file, RunResult& result)
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

void run(const Options& options, Session& session) {
  const CatalogueScene entry = make_scene(session, options.scene, parameters(options.set));
  const Momentum representative = momentum(options.momentum);
  if (options.every < 1) throw Misuse(fmt::format("--every = {}; 1 or more is needed", options.every));
  const StepGrid grid = fitted_steps(entry, options.end.value_or(entry.t_end), options.step);
  Integrator integrator(entry.scene, session.registry, session.solvers,
                        {options.method, options.order, grid.step, rule(session, options.rule)});
  std::optional<TrajectoryFile> file;
  if (!options.out.empty()) file.emplace(options.out, *entry.scene);

  RunResult result;
  result.momentum = representative;
  Trajectory(integrator, representative, options.every, file ? &*file : nullptr, result).run(grid.steps);
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
  if (!result.doubt.empty()) say(result.doubt);
  if (result.failure.empty()) return;
  say(result.failure);
  session.exit_status = failed;
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
  verb->add_option("--set", options->set, "Set a parameter of the scene; may be repeated")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer(
      "Examples:\n"
      "  diracstep run knife_edge --step 0.05 --out knife_edge.csv\n"
      "  diracstep run kepler_e06 --order 8 --end 100 --set e=0.3 --every 10 --out orbit.csv");
  verb->callback([options, &session] { run(*options, session); });
}

}  // namespace diracstep::command
