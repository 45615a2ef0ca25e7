#pragma once

#include <diracstep/core/dirac/discrete_rows.hpp>
#include <diracstep/core/methods/default_method.hpp>
#include <diracstep/core/steps/matrix_form.hpp>
#include <optional>
#include <string>

namespace diracstep {

/// How a scene is stepped; everything but the step size has a default.
struct IntegratorOptions {
  std::string method = automatic_method;  ///< a name of the registry, or "auto": see default_method();
                                          ///< default_method_of_motion() looks at the damping of a motion too
  int order = 0;  ///< composed to this order, methods that are not self-adjoint with their adjoint; 0 keeps
                  ///< the method's own
  double step = 0.0;  ///< step size, may be negative; must be given
  std::optional<ConstraintRule> constraint_rule = std::nullopt;  ///< instead of the method's own
  int dense_limit = as_measured;  ///< up to so many unknowns n + m full matrices; see matrix_form()
  bool force_degenerate = false;  ///< use a method on a degenerate scene that is known to be unstable there
  bool project_start = false;     ///< move an inconsistent start onto the constraints instead of refusing it
  bool drop_redundant_rows = false;  ///< leave out redundant constraints also where the scene refuses them
  int substeps = 1;  ///< a step that cannot be solved is taken in 2, 4, … up to so many smaller ones
  bool compensated_sums = false;  ///< sums of a step in extended precision, what rounding drops carried on:
                                  ///< round-off in the energy then grows like a random walk, see
                                  ///< StepProblem::compensate.  Pays over very many steps
};

/// One decision of the plan: what is done or left out, and why.
struct PlanLine {
  std::string item;
  std::string decision;
  std::string reason;
};

}  // namespace diracstep
