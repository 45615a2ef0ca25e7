#include <cmath>
#include <diracstep/boundary_values/guesses.hpp>
#include <diracstep/boundary_values/named_ends.hpp>
#include <diracstep/boundary_values/other_solutions.hpp>
#include <diracstep/c_interface/point_writer.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/scene_format/parametric_scene_file.hpp>
#include <diracstep/scene_format/position_names.hpp>

using namespace diracstep;
using namespace diracstep::c_interface;

namespace {

/// Method, rule and equal steps from the scene's start to the end of the options.
struct EqualSteps {
  EqualSteps(const diracstep_model& model, const diracstep_options& given)
      : solvers(solvers_from(given)), options(stepping_from(model, given)) {
    require_flat(*entry_of(model).scene, "a search for a motion between two ends");
    if (!model.entry.events.empty())
      throw Misuse(
          "a motion between two ends does not go with the events of the scene: when one is met is not known "
          "before");
    if (steps_vary(given)) throw Misuse("a motion between two ends takes steps of one size");
    if (given.pushed != 0) throw Misuse("a motion between two ends goes with no push");
    const double start = model.scene->start.time, end = end_from(model, given);
    require_inputs_until(entry_of(model), end, "the end");
    const StepGrid grid = fit_steps(start, end, open_step(model, given, start));
    count = grid.steps;
    options.step = grid.step;
  }

  SolverFactory solvers;
  IntegratorOptions options;
  long count = 0;
};

std::string method_of(const diracstep_model& model, const EqualSteps& steps) {
  return Integrator(model.entry.scene, model.registry, steps.solvers, steps.options).method().name;
}

std::function<bool()> until_stopped(const diracstep_ends& ends) {
  return [stop = ends.stop] { return !stopped(stop); };
}

std::optional<GuessedMotion> given_guess(const diracstep_ends& ends, int n) {
  if (ends.guesses == 0) return std::nullopt;
  if (ends.guesses < 0) throw Misuse("guesses is " + std::to_string(ends.guesses) + "; 0 or more are needed");
  const auto columns = [&](const double* numbers, const char* what) {
    return Columns(Eigen::Map<const Columns>(&given(numbers, what), n, ends.guesses));
  };
  return through_points(
      Eigen::Map<const Vector>(&given(ends.guess_time, "the times of the guess"), ends.guesses),
      columns(ends.guess_q, "q of the guess"), columns(ends.guess_v, "v of the guess"));
}

/// The ends of the steps.  Forces of rows, and outputs that read them, are not known there: NaN.
template <class Report>
void write_nodes(const diracstep_model& model, const Report& report, diracstep_points& points) {
  PointWriter writer(points, model.entry);
  for (Eigen::Index k = 0; k < report.times.size(); ++k) {
    Sample point;
    point.time = report.times[k];
    point.q = report.q.col(k);
    point.v = report.v.col(k);
    point.p = report.p.col(k);
    point.energy = model.scene->energy({point.time, point.q, point.v, point.p});
    point.lambda = Vector::Constant(model.entry.scene->rows(), std::nan(""));
    writer.write(point);
  }
}

BoundaryConditions conditions_of_boundary(const diracstep_model& model, const diracstep_ends& ends) {
  const NamedNumbers start = named_values(ends.of_start, ends.at_start, "number asked of the start"),
                     end = named_values(ends.of_end, ends.at_end, "number asked of the end");
  if (ends.periodic == 0) {
    if (end.empty()) throw Misuse("nothing is asked of the end, and the motion is not to be periodic");
    return conditions_at_ends(*model.entry.scene, start, end);
  }
  if (!start.empty() || !end.empty())
    throw Misuse("a periodic motion has all of both ends: nothing else can be asked of them");
  return periodic(model.scene->dimension());
}

void tell_boundary(const BoundaryReport& report, diracstep_boundary& found) {
  found.iterations = report.iterations;
  found.correction = report.correction;
  found.residual = report.residual;
  found.doubt = keep(report.doubt);
  found.no_action = keep(report.no_action);
  if (report.action) {
    found.action = report.action->value;
    found.gradient = keep_entries(report.action->gradient);
    if (report.action->hessian.size() > 0) found.hessian = keep_matrix(report.action->hessian);
  }
  found.free_directions = report.free_directions;
  found.multipliers = static_cast<int>(report.multipliers.size());
  std::vector<double> parts;
  for (const auto& value : report.multipliers) parts.insert(parts.end(), {value.real(), value.imag()});
  if (!parts.empty()) found.multiplier = keep_numbers(std::move(parts));
}

void solve_ends(const diracstep_model& model, const diracstep_options& options, const diracstep_ends& ends,
                diracstep_points& points, diracstep_boundary& found) {
  const EqualSteps steps(model, options);
  BoundaryProblem problem{
      model.entry.scene, model.registry, steps.solvers, steps.options, steps.count, {}, {}};
  problem.conditions = conditions_of_boundary(model, ends);
  const std::optional<GuessedMotion> guess = given_guess(ends, model.scene->dimension());
  problem.guess = guess ? *guess : usual_guess(problem);
  if (ends.max_iterations > 0) problem.max_iterations = ends.max_iterations;
  problem.go_on = until_stopped(ends);
  BoundaryReport report = solve_boundary_values(problem);
  const bool places = report.converged && problem.conditions.start_held && problem.conditions.end_held;
  if (places && report.doubt.empty()) report.doubt = doubt_of_steps(problem, report);
  tell_boundary(report, found);
  if (places && !guess) found.other = keep(other_motion(problem, report));
  found.method = keep(method_of(model, steps));
  write_nodes(model, report, points);
  if (report.interrupted) throw Interruption(report.ending);
  if (!report.converged) throw Failure(report.ending);
}

SceneControl control_of(const diracstep_model& model) {
  return model.text.empty() ? scene_control(model.name, model.entry, model.changes)
                            : scene_control_from_text(model.name, model.text, model.entry, model.changes);
}

BoundaryConditions conditions_of_control(const diracstep_model& model, const diracstep_ends& ends,
                                         bool end_counts) {
  const NamedNumbers start = named_values(ends.of_start, ends.at_start, "number asked of the start"),
                     end = named_values(ends.of_end, ends.at_end, "number asked of the end");
  if (ends.periodic != 0) throw Misuse("controls are not searched for periodic motions");
  if (end.empty() && !end_counts)
    throw Misuse("nothing is asked of the end, and no 'end_cost' of [control] says what an end costs");
  return start.empty() ? conditions_from_start(*model.scene, end)
                       : conditions_at_ends(*model.entry.scene, start, end);
}

void tell_control(const OptimalControlReport& report, const std::vector<std::string>& names,
                  diracstep_controlled& found) {
  found.iterations = report.iterations;
  found.cost = report.cost;
  found.residual = report.residual;
  found.end_of_run = report.end_of_run;
  found.doubt = keep(report.doubt);
  found.controls = static_cast<int>(names.size());
  found.name = keep(1, names).cells;
  found.control_points = report.control_times.size();
  found.control_time = keep_entries(report.control_times);
  found.control_value = keep_entries(report.controls);
}

void solve_controls(const diracstep_model& model, const diracstep_options& options,
                    const diracstep_ends& ends, const diracstep_control& control, diracstep_points& points,
                    diracstep_controlled& found) {
  const EqualSteps steps(model, options);
  const SceneControl of = control_of(model);
  ControlProblem problem{
      {model.entry.scene, of.names, of.force, of.cost, of.end_cost, of.lower, of.upper, of.kinks},
      model.registry,
      steps.solvers,
      steps.options,
      steps.count,
      conditions_of_control(model, ends, of.end_cost != nullptr),
      {}};
  problem.guessed_controls = of.values;
  problem.degree = control.degree;
  if (ends.max_iterations > 0) problem.max_iterations = ends.max_iterations;
  if (control.tolerance != 0.0) problem.tolerance = control.tolerance;
  set_bounds(problem, named_values(control.of_least, control.least, "bound from below"),
             named_values(control.of_greatest, control.greatest, "bound from above"));
  const std::optional<GuessedMotion> guess = given_guess(ends, model.scene->dimension());
  problem.guess = guess ? *guess : usual_guess(problem);
  problem.go_on = until_stopped(ends);
  const OptimalControlReport report = solve_optimal_control(problem);
  tell_control(report, of.names, found);
  found.method = keep(method_of(model, steps));
  write_nodes(model, report, points);
  if (report.interrupted)
    throw Interruption("interrupted after " + std::to_string(report.iterations) + " iterations");
  if (!report.converged) throw Failure(report.ending);
}

}  // namespace

int diracstep_solve_boundary(const diracstep_model* model, const diracstep_options* options,
                             const diracstep_ends* ends, diracstep_points* points,
                             diracstep_boundary* found) {
  return guarded([&] {
    diracstep_boundary& told = given(found, "where the findings go");
    told = {};
    told.method = told.doubt = told.other = told.no_action = "";
    told.action = std::nan("");
    solve_ends(given(model, "the model"), options != nullptr ? *options : diracstep_options{},
               given(ends, "what is asked of the ends"), given(points, "where the points go"), told);
  });
}

int diracstep_solve_control(const diracstep_model* model, const diracstep_options* options,
                            const diracstep_ends* ends, const diracstep_control* control,
                            diracstep_points* points, diracstep_controlled* found) {
  return guarded([&] {
    diracstep_controlled& told = given(found, "where the findings go");
    told = {};
    told.method = told.doubt = "";
    if (!optimal_control_available())
      throw Misuse("optimal control needs Ipopt, and this library was built without");
    solve_controls(given(model, "the model"), options != nullptr ? *options : diracstep_options{},
                   given(ends, "what is asked of the ends"),
                   control != nullptr ? *control : diracstep_control{}, given(points, "where the points go"),
                   told);
  });
}

int diracstep_can_control(void) { return optimal_control_available() ? 1 : 0; }
