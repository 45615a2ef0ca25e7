#include <cmath>
#include <diracstep/c_interface/handles.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/solvers/direct_solver.hpp>

using namespace diracstep;

namespace diracstep::c_interface {

namespace {

/// Whether the method, and where no step is given the step too, are those that the scene's file recommends.
bool recommended(const diracstep_model& model, const diracstep_options& options) {
  return options.method == nullptr && options.order == 0 && entry_of(model).recommended.stated;
}

}  // namespace

Momentum momentum_from(int momentum) {
  switch (momentum) {
    case DIRACSTEP_PROJECTED:
      return Momentum::projected;
    case DIRACSTEP_PLUS:
      return Momentum::plus;
    case DIRACSTEP_MINUS:
      return Momentum::minus;
    default:
      throw Misuse("momentum is " + std::to_string(momentum) + "; 0 (projected), 1 (plus), 2 (minus)");
  }
}

SolverFactory solvers_from(const diracstep_options& options) {
  KinsolOptions solver;
  if (options.jacobian != nullptr) solver.jacobian = jacobian_policy(options.jacobian);
  return named_solver(options.solver != nullptr ? options.solver : "newton", solver);
}

IntegratorOptions stepping_from(const diracstep_model& model, const diracstep_options& options) {
  IntegratorOptions stepping;
  if (recommended(model, options)) {
    stepping.method = model.entry.recommended.method;
    stepping.order = model.entry.recommended.order;
  } else {
    if (options.method != nullptr) stepping.method = options.method;
    stepping.order = options.order;
  }
  if (options.rule != nullptr) stepping.constraint_rule = model.registry.rule(options.rule);
  stepping.project_start = options.project_start != 0;
  stepping.compensated_sums = options.compensated_sums != 0;
  if (options.substeps != 0) stepping.substeps = options.substeps;
  return stepping;
}

StepControl control_from(const diracstep_options& options) {
  return step_control(options.control != nullptr ? options.control : "integrating");
}

double end_from(const diracstep_model& model, const diracstep_options& options) {
  const double end = options.ends != 0 ? options.end : entry_of(model).t_end;
  if (!std::isfinite(end)) throw Misuse("the end is " + to_text(end) + "; a finite time is needed");
  return end;
}

double step_from(const diracstep_model& model, const diracstep_options& options) {
  return step_from(model, options, model.scene->start.time);
}

double step_from(const diracstep_model& model, const diracstep_options& options, double start) {
  const CatalogueScene& entry = entry_of(model);
  const double forward = end_from(model, options) - start;
  double step = options.step;
  if (step == 0.0)
    step = std::copysign(recommended(model, options) ? entry.recommended.step : entry.natural_step, forward);
  if (steps_vary(options)) return std::copysign(step, forward);
  return options.ends != 0 ? fit_steps(start, options.end, step).step : step;
}

}  // namespace diracstep::c_interface
