#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/system/event.hpp>
#include <functional>
#include <span>
#include <vector>

namespace diracstep {

/// Where one trajectory of an ensemble ended; `last` says why it stopped early, if it did, and `end` is then
/// the last point that could be read.
struct EnsembleMember {
  StepReport last;
  Sample end;
  std::string doubt = {};  ///< empty, or what the checks of a run found, where they went along
};

/// Events of the scene, and all its rows where these switch some, as EventSteps takes them.
struct EnsembleEvents {
  std::shared_ptr<const Scene> all_rows = {};
  std::vector<Event> events = {};
};

/// Takes `steps` steps from each of the starts, which must be consistent (with a velocity or a momentum), and
/// reads the ends, in the order of the starts.
///
/// Each of `threads` threads (0: one for each processor) has an integrator of its own, made once and reset
/// for each start, so the results are the same bits for every number of threads.  Throws Misuse as the
/// integrator does, for an inconsistent start as well; an exception of the scene's own functions ends the
/// ensemble and passes through.  `goes_on`, where given, is asked before each member by the thread that takes
/// it; after false no further member is begun, and those left have an empty end.
///
/// Members spread evenly over the starts, at most twenty, are run with the checks of a run (RunChecks), which
/// cost a few steps more each and at most a second run.  Through events members go without checks, and one
/// that an event stops ends there.
std::vector<EnsembleMember> run_ensemble(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                                         const SolverFactory& solvers, const IntegratorOptions& options,
                                         std::span<const Start> starts, long steps,
                                         Momentum momentum = Momentum::projected, int threads = 0,
                                         const std::function<bool()>& goes_on = {},
                                         const EnsembleEvents& events = {});

}  // namespace diracstep
