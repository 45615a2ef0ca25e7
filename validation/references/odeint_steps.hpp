#pragma once

#include <diracstep/validation/references/explicit_reference.hpp>
#include <diracstep/validation/references/sized_equations.hpp>

namespace diracstep {

/// Whether the build has Boost.odeint.
bool has_odeint();

/// Steps of Boost.odeint from y at time `t` to t_end, by `code`, which is not ARKODE's; y and t end where it
/// got to.  The counts and a failure go to `run`.
void integrate_by_odeint(SizedEquations& equations, ExplicitCode code, double t_end,
                         const ReferenceOptions& options, double* y, double& t, ReferenceRun& run);

}  // namespace diracstep
