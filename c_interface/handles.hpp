#pragma once

#include <diracstep/c_interface/diracstep.h>

#include <cmath>
#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/plugins/loaded_plugin.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <functional>
#include <memory>
#include <string>
#include <variant>
#include <vector>

/// A scene with what is known of it, and the methods and plugins it was opened with.
struct diracstep_model {
  diracstep::Registry registry = diracstep::Registry::with_built_ins();
  std::vector<diracstep::Plugin> plugins;
  diracstep::CatalogueScene entry;                ///< its scene as given; null in a model for lists
  std::shared_ptr<const diracstep::Scene> scene;  ///< completed
  std::string name, text;                         ///< what the scene was made from, where it is from a file
  diracstep::Parameters changes;
};

/// Steps of fixed size or of varying size, and what the last run's checks found.
struct diracstep_integrator {
  std::variant<diracstep::Integrator, diracstep::AdaptiveIntegrator> stepper;
  std::shared_ptr<const diracstep::Scene> scene;  ///< completed
  std::vector<diracstep::Invariant> invariants;
  bool invariants_by_momentum, has_events;
  diracstep::Parameters parameters;
  std::vector<diracstep::PlanLine> notes;  ///< of the model, for the plan
  double end;                              ///< where a run ends that names none
  std::shared_ptr<diracstep::Vector> push = {};
  std::function<diracstep::Integrator()> side = {};  ///< where steps vary: one more, for the checks of a run
  std::string doubt = {};
  diracstep::Sample sample = {};

  diracstep::Integrator* fixed() { return std::get_if<diracstep::Integrator>(&stepper); }
  const diracstep::Integrator& stepping() const;
};

namespace diracstep::c_interface {

/// An Error of DIRACSTEP_FAILED: what was tried and did not succeed.
class Failure : public Error {
 public:
  using Error::Error;
};
/// One of DIRACSTEP_INTERRUPTED.
class Interruption : public Error {
 public:
  using Error::Error;
};

/// Keeps the text of the exception in flight for diracstep_message; the code that a function returns for it.
int code_of_exception() noexcept;

/// Forgets the texts that the last call of this thread has given.
void begin_call() noexcept;

/// Runs `action`; no exception leaves.
template <class Action>
int guarded(Action action) noexcept {
  begin_call();
  try {
    action();
    return DIRACSTEP_OK;
  } catch (...) {
    return code_of_exception();
  }
}

/// Throws Misuse where something that is needed is NULL.
template <class Handle>
Handle& given(Handle* handle, const char* what) {
  if (handle == nullptr) throw Misuse(std::string(what) + " is NULL");
  return *handle;
}

/// The model's scene; throws Misuse where it has none.
const CatalogueScene& entry_of(const diracstep_model& model);

/// Texts that C reads, kept until the next call of this thread.
const char* keep(std::string text);
diracstep_table keep(int columns, std::vector<std::string> cells);

Momentum momentum_from(int momentum);
SolverFactory solvers_from(const diracstep_options& options);
/// All but the step.
IntegratorOptions stepping_from(const diracstep_model& model, const diracstep_options& options);
StepControl control_from(const diracstep_options& options);
/// Where the motion ends, and the step that leads there from the scene's start or another, with its sign.
/// Whether the options ask for steps of varying size.
inline bool steps_vary(const diracstep_options& options) {
  return options.eps > 0.0 || std::isnan(options.eps);
}
double end_from(const diracstep_model& model, const diracstep_options& options);
double step_from(const diracstep_model& model, const diracstep_options& options);
double step_from(const diracstep_model& model, const diracstep_options& options, double start);

/// Whether the caller has asked for the end; false without a flag.
bool stopped(const int* flag);

}  // namespace diracstep::c_interface
