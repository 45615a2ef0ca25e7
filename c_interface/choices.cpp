#include <cmath>
#include <diracstep/c_interface/handles.hpp>
#include <diracstep/core/adaptive/damping_survey.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/solvers/direct_solver.hpp>

using namespace diracstep;

namespace diracstep::c_interface {

namespace {

/// Whether the method, and where no step is given the step too, are those that the scene's file recommends.
bool recommended(const diracstep_model& model, const diracstep_options& options) {
  return options.method == nullptr && options.order == 0 && !steps_vary(options) &&
         entry_of(model).recommended.stated;
}

}  // namespace

Parameters named_values(int count, const diracstep_parameter* list, const char* what) {
  Parameters values;
  if (count > 0) (void)given(list, what);
  for (int k = 0; k < count; ++k)
    values[&given(list[k].name, (std::string("the name of a ") + what).c_str())] = list[k].value;
  return values;
}

std::vector<std::string> texts_of(int count, const char* const* list, const char* what) {
  std::vector<std::string> texts;
  if (count > 0) (void)given(list, what);
  for (int k = 0; k < count; ++k)
    texts.emplace_back(&given(list[k], (std::string(what) + ", one of them,").c_str()));
  return texts;
}

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

void choose_method(const diracstep_model& model, diracstep_options& options, IntegratorOptions& stepping) {
  if (stepping.method != automatic_method || options.pushed != 0) return;
  const double end = end_from(model, options);
  if (end == model.scene->start.time) return;
  const DefaultMethod choice = default_method_of_motion(
      entry_of(model).scene, model.registry, solvers_from(options), end, std::abs(stepping.step), stepping,
      {stepping.order, 0.0, stepping.constraint_rule, large_from(stepping.dense_limit)});
  if (!model.registry.method(choice.method).info.damped) return;
  stepping.method = choice.method;
  const bool fixed = options.fixed != 0 || options.step != 0.0 || options.substeps > 1;
  if (std::isnan(options.eps) || (options.eps == 0.0 && !fixed)) options.eps = choice.local_error;
}

StepControl control_from(const diracstep_options& options) {
  return step_control(options.control != nullptr ? options.control : "integrating");
}

double end_from(const diracstep_model& model, const diracstep_options& options) {
  const double end = options.ends != 0 ? options.end : entry_of(model).t_end;
  if (!std::isfinite(end)) throw Misuse("the end is " + to_text(end) + "; a finite time is needed");
  return end;
}

double open_step(const diracstep_model& model, const diracstep_options& options, double start) {
  if (options.step != 0.0) return options.step;
  const CatalogueScene& entry = entry_of(model);
  return std::copysign(recommended(model, options) ? entry.recommended.step : entry.natural_step,
                       end_from(model, options) - start);
}

double fitted_step(const diracstep_options& options, double start, double step) {
  return options.ends != 0 ? fit_steps(start, options.end, step).step : step;
}

}  // namespace diracstep::c_interface
