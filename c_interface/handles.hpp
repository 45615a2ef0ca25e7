#pragma once

#include <diracstep/c_interface/diracstep.h>

#include <cmath>
#include <diracstep/core/adaptive/checked_motion.hpp>
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
  bool drop_redundant = false;
};

namespace diracstep::c_interface {

using FixedMotion = EventSteps<Integrator>;
using VariableMotion = EventSteps<AdaptiveIntegrator>;

/// What the checks of steps taken one by one have found; they begin anew where another motion begins.
struct StepChecks {
  std::optional<CheckedMotion<Integrator>> fixed;
  std::optional<CheckedMotion<AdaptiveIntegrator>> varying;
  std::optional<StepSizeCheck> pushed;  ///< in place of them: a force that is changed between steps
  std::string found;                    ///< by those before

  std::string text() const;
  void see(const Sample& point);
  void begin_anew();
  void clear();
};

}  // namespace diracstep::c_interface

/// A motion by steps of fixed size or of varying size, through the events of its scene.
struct diracstep_integrator {
  using Motion = std::variant<std::unique_ptr<diracstep::c_interface::FixedMotion>,
                              std::unique_ptr<diracstep::c_interface::VariableMotion>>;
  diracstep::CatalogueScene entry;                      ///< with the force of `push`
  std::shared_ptr<const diracstep::Scene> scene;        ///< of the model, completed
  std::function<Motion(const diracstep::Start*)> make;  ///< from the scene's start without one
  std::vector<diracstep::PlanLine> notes;               ///< of the model, for the plan
  double end;                                           ///< where a run ends that names none
  std::shared_ptr<diracstep::Vector> push = {};
  /// One more of the scene that is stepped, for the checks where steps vary.
  std::function<diracstep::Integrator(const diracstep::Integrator&)> side = {};
  Motion motion = {};
  diracstep::c_interface::StepChecks checks = {};  ///< of single steps
  std::string doubt = {};                          ///< of the last run
  diracstep::Sample sample = {};

  const diracstep::Integrator& stepping() const;
  /// The point of the event that has ended the motion, or null.
  const diracstep::Sample* event_at_end() const;
  double time() const;
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
/// What C reads that is neither.
void keep(std::shared_ptr<const void> owner);

/// Numbers in the order they lie in memory: those of a matrix column by column.  Null for none.
const double* keep_numbers(std::vector<double> numbers);
template <class Numbers>
const double* keep_entries(const Numbers& numbers) {
  return numbers.size() > 0 ? keep_numbers({numbers.data(), numbers.data() + numbers.size()}) : nullptr;
}

/// Row by row.
inline const double* keep_matrix(const Columns& matrix) { return keep_entries(Columns(matrix.transpose())); }

/// So many texts; throws Misuse where one is NULL, `what` they are.
std::vector<std::string> texts_of(int count, const char* const* list, const char* what);
/// So many numbers by name; throws Misuse where one has none, `what` it is.
Parameters named_values(int count, const diracstep_parameter* list, const char* what);

Momentum momentum_from(int momentum);
SolverFactory solvers_from(const diracstep_options& options);
/// All but the step.
IntegratorOptions stepping_from(const diracstep_model& model, const diracstep_options& options);
StepControl control_from(const diracstep_options& options);
/// Whether the options ask for steps of varying size.
inline bool steps_vary(const diracstep_options& options) {
  return options.eps > 0.0 || std::isnan(options.eps);
}
/// What is left open filled in as the command `run` does it: the method, and eps where strong damping makes
/// steps vary.
void choose_method(const diracstep_model& model, diracstep_options& options, IntegratorOptions& stepping);
/// Where the motion ends, and the step in that direction from where it starts; before choose_method(), which
/// takes it for that of fixed steps.
double end_from(const diracstep_model& model, const diracstep_options& options);
double open_step(const diracstep_model& model, const diracstep_options& options, double start);
/// So that whole steps lead to the end of the options, where these have one.
double fitted_step(const diracstep_options& options, double start, double step);

/// An integrator as diracstep_create() makes it.
std::unique_ptr<diracstep_integrator> make_integrator(const diracstep_model& model,
                                                      diracstep_options options);
/// One run, as diracstep_run() takes it.
void run_course(diracstep_integrator& handle, const diracstep_course& course, diracstep_points& points);
/// The events met so far; they point into the handle.
std::vector<diracstep_event> events_of(const diracstep_integrator& handle);

/// Whether the caller has asked for the end; false without a flag.
bool stopped(const int* flag);

/// The motion of a handle by steps of one size; throws Misuse where they vary, `what` needs one.
FixedMotion& fixed_of(const diracstep_integrator& handle, const char* what);

/// About so many steps lead to `end`; more than there are numbers for count as none.
long steps_left(const Integrator& integrator, double end);
/// The checks of a run from where a motion stands, to about `end`.
std::function<RunChecks()> checks_of(const diracstep_integrator& handle, FixedMotion& motion, double end);
std::function<VariableRunChecks()> checks_of(const diracstep_integrator& handle, VariableMotion& motion,
                                             double end);

}  // namespace diracstep::c_interface
