#pragma once

#include <diracstep/core/integrator/integrator_options.hpp>
#include <diracstep/core/integrator/step_sequence.hpp>
#include <diracstep/core/methods/registry.hpp>
#include <memory>

namespace diracstep {

/// The method that the options ask for.  "auto" in them is replaced by what it stands for and the order 0 by
/// the method's own; a choice made here is added to the plan.  Throws Misuse for an unknown name.
Method chosen_method(const Scene& scene, const Registry& registry, IntegratorOptions& options,
                     std::vector<PlanLine>& plan);

/// The step of a method, composed where the options ask for another order than its own: that of a
/// self-adjoint method; others are followed by their adjoint with half the step each, which is self-adjoint
/// and of the next even order.  Throws Misuse for an order that cannot be had, and for a rule or compensated
/// sums that the method does not know.
StepDesign design_step(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                       const Method& method, const IntegratorOptions& options, bool full);

}  // namespace diracstep
