#pragma once

#include <diracstep/core/steps/step_problem.hpp>

namespace diracstep {

/// The step of dirac_step() where the generating function solves its graph for the end (its explicit_graph()
/// is not null) and no force acts: what is left to solve are the rows for the multipliers.
std::unique_ptr<StepProblem> multiplier_step(std::unique_ptr<GeneratingFunction> generating_function,
                                             const Scene& scene, const ConstraintRule& rule, bool dense);

}  // namespace diracstep
