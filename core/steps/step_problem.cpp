#include <diracstep/core/steps/implicit_step.hpp>
#include <diracstep/core/steps/multiplier_step.hpp>
#include <diracstep/core/steps/step_problem.hpp>
#include <utility>

namespace diracstep {

std::unique_ptr<StepProblem> dirac_step(std::unique_ptr<GeneratingFunction> generating_function,
                                        const Scene& scene, const ConstraintRule& rule, bool dense) {
  const bool solved = generating_function->explicit_graph() != nullptr && !scene.force;
  return solved ? multiplier_step(std::move(generating_function), scene, rule, dense)
                : implicit_step(std::move(generating_function), scene, rule, dense);
}

}  // namespace diracstep
