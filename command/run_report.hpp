#pragma once

#include <diracstep/command/run_sensitivities.hpp>
#include <diracstep/command/variable_steps.hpp>
#include <diracstep/core/runs/event_steps.hpp>
#include <diracstep/validation/studies/study_run.hpp>
#include <optional>
#include <string>
#include <vector>

namespace diracstep::command {

/// Something that a scene declares as kept, at both ends of a run.
struct InvariantEnds {
  std::string name;
  double start, end;
  std::optional<double> stated;
};

/// What one run came to.
struct RunResult {
  std::string failure;  ///< empty, or why it stopped early
  Momentum momentum = Momentum::projected;
  Sample end;  ///< the last point that could be read; empty columns where there is none
  Work work;
  std::optional<VariableSteps> variable;     ///< where the steps varied
  std::optional<ErrorControlReport> search;  ///< where an error was asked for
  StudyRow check;                            ///< errors against the reference at that time, rows and energy
  std::string doubt;                         ///< empty, or why the points are not to be believed
  std::vector<InvariantEnds> invariants;
  std::vector<std::pair<std::string, double>> outputs;  ///< of the scene, at the end
  std::vector<SensitivityColumn> sensitivities;         ///< of the end, where they were asked for
  std::vector<Event> events;                            ///< of the scene
  std::vector<EventHit> hits;                           ///< where they were met
  std::shared_ptr<const Scene> scene_at_end;            ///< of the rows that are on there
  bool stopped = false;                                 ///< by the last of these
  std::vector<std::string> notes;                       ///< of the start
  std::string out;                                      ///< the file written, if any
  long lines = 0;                                       ///< points in it

  bool has_end() const { return end.q.size() > 0; }
};

template <class Stepper>
void take_events(const EventSteps<Stepper>& motion, RunResult& result) {
  result.events = motion.events();
  result.hits = motion.hits();
  result.stopped = motion.stopped();
  result.notes = motion.notes();
  if (!result.events.empty()) result.scene_at_end = std::make_shared<const Scene>(motion.scene());
}

/// Fills in `check`, the scene being the integrator's; its errors stay NaN where there is no reference at the
/// end.
void compare_with_reference(RunResult& result, const CatalogueScene& entry, const Scene& scene);

std::string run_text(const RunResult& result, const CatalogueScene& entry, const IntegratorOptions& options);
std::string run_json(const RunResult& result, const CatalogueScene& entry, const IntegratorOptions& options);

}  // namespace diracstep::command
