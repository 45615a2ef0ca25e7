#pragma once

#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/runs/run.hpp>
#include <span>

namespace diracstep {

class VariableRunChecks;

/// Takes `steps` steps and shows the start, every `every`-th node and the last one, as for an Integrator.
/// `checks`, where given, see the same points and every step; so below.
RunReport run_steps(AdaptiveIntegrator& integrator, long steps, Momentum momentum = Momentum::projected,
                    long every = 1, const Observer& observer = nullptr, VariableRunChecks* checks = nullptr);

/// Steps as long as the next one does not pass the time `end`, and shows the start, every `every`-th node and
/// the motion at `end`, which a side step reaches, as for an Integrator.  Throws Misuse where `end` is not
/// finite or does not lie ahead.
RunReport run_until(AdaptiveIntegrator& integrator, double end, Momentum momentum = Momentum::projected,
                    long every = 1, const Observer& observer = nullptr, VariableRunChecks* checks = nullptr);

/// Shows the motion at the given times, which must run from the current node in the direction of the motion,
/// by side steps.  Throws Misuse for times out of order.
RunReport run_at(AdaptiveIntegrator& integrator, std::span<const double> times,
                 Momentum momentum = Momentum::projected, const Observer& observer = nullptr,
                 VariableRunChecks* checks = nullptr);

/// AdaptiveIntegrator::sample_at().
StepReport sample_at(AdaptiveIntegrator& integrator, double t, Momentum momentum, Sample& sample);

}  // namespace diracstep
