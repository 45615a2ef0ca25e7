#pragma once

#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/system/event.hpp>

namespace diracstep {

/// solve_to_error() for a motion through events (EventSteps takes `start`, `all` and the events): fixed
/// steps, halved from run to run, whose ends are compared.  Accepted is a run by the rules of Convergence,
/// where it meets the same events in the same order as the runs it is compared with; where an event stops the
/// motion, its time counts as well, in parts of the time to `end`.  The order holds across events, since
/// their times have the order of the method.
///
/// Of the options `adaptive`, `monitor` and `control` are not used, and first_step is needed.  Forces are not
/// surveyed between the nodes, as solve_to_error() does.
ErrorControlReport solve_events_to_error(const std::shared_ptr<const Scene>& start,
                                         const std::shared_ptr<const Scene>& all,
                                         const std::vector<Event>& events, const Registry& registry,
                                         const SolverFactory& solvers, double end,
                                         const ErrorControlOptions& options);

}  // namespace diracstep
