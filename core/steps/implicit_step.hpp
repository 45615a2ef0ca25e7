#pragma once

#include <diracstep/core/steps/step_problem.hpp>

namespace diracstep {

/// The step of dirac_step() with its graph and constraint solved together: for any generating function.
std::unique_ptr<StepProblem> implicit_step(std::unique_ptr<GeneratingFunction> generating_function,
                                           const Scene& scene, const ConstraintRule& rule, bool dense);

}  // namespace diracstep
