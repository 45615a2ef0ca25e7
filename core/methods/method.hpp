#pragma once

#include <diracstep/core/dirac/discrete_rows.hpp>
#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/dirac/step_rule.hpp>
#include <diracstep/core/steps/step_problem.hpp>
#include <diracstep/core/system/scene.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace diracstep {

/// What is stated of a method, and what an integrator needs to know to use it.
struct MethodInfo {
  std::string name;                    ///< "type1/midpoint"
  std::optional<GeneratingType> type;  ///< the type of its generating function; none of a damping method
  int order;                           ///< stated order in q and in projected p
  bool self_adjoint;                   ///< Φ_{−h} = Φ_h⁻¹
  StepRule constraint_rule;            ///< the rule for Δ^d_Q that keeps its order
  std::string summary;                 ///< its formula in a line
  std::string adjoint = {};   ///< the method that is its adjoint, if there is one by name; else one is made
  int constrained_order = 0;  ///< stated order on scenes with rows or a force; 0: the same
  bool allocation_free = false;  ///< it states that evaluating its generating function allocates no memory
  int stages = 0;                ///< S of a step GL(S); 0 for others
  /// What is too fast for a step is damped by it, |R(∞)| = 0, and its steps may vary by their local error: a
  /// method of the damping family, which is neither symplectic nor reversible.
  bool damped = false;
  /// Rows and forces act at nodes inside the step, which no function of the end points knows: with them a
  /// step is a member of the Dirac structure of its stage space (methods/gauss_lobatto.hpp).
  bool rows_inside = false;
  /// Empty where the step has the unknowns of dirac_step(); else the other unknowns in which the same step
  /// is solved.  It is the same to round-off, which the law suite holds for every registered method.
  std::string solved_as = {};
};

/// How the step of a method is wanted.
struct StepChoices {
  bool dense = false;                       ///< its Jacobian as a full matrix
  std::optional<ConstraintRule> rule = {};  ///< for Δ^d_Q, in place of the method's own
  bool force_degenerate = false;            ///< also where the method is known to be unstable
};

/// Makes the generating function of a method for a scene that was completed; throws Misuse where the scene
/// lacks what the method needs, as a degenerate Hamiltonian lacks a Lagrangian.
using GeneratingFunctionFactory = std::function<std::unique_ptr<GeneratingFunction>(const Scene&)>;

/// Makes the step of a method for such a scene.  Throws Misuse for another rule where the rows of the method
/// hold inside the step, and for a degenerate scene (a Lagrangian linear in v or in some of them) where the
/// method is not one of the Gauss-Lobatto or the damping family, unless forced: one-sided and trapezoidal
/// rules are unstable there.
using StepFactory = std::function<std::unique_ptr<StepProblem>(const Scene&, const StepChoices&)>;

/// A method ready for use.  A method that has a generating function S steps that S: on every scene without
/// rows inside the step, make_step solves the step that dirac_step() states for S.
struct Method {
  MethodInfo info;
  StepFactory make_step;
  GeneratingFunctionFactory generating_function = {};  ///< empty where none is stated
};

/// The method that steps a generating function by dirac_step().
Method method_of(MethodInfo info, GeneratingFunctionFactory generating_function);

/// GL(s) under the name typeN/gl:S, with its generating function of type N = 1, 2 or 3.  Throws Misuse for
/// type 4, and unless 1 ≤ s ≤ 20.
Method gauss_lobatto_method(GeneratingType type, int s);

/// damped/radau:S, Radau IIA with s stages (steps/radau/step.hpp).  Throws Misuse unless 1 ≤ s ≤ 5.
Method radau_method(int s);

/// L_d = h L((q0+q1)/2, (q1−q0)/h), type 1.  With its own rule for the rows it is solved as GL(1), whose
/// unknown is the velocity: the same step, which loses a factor h less to round-off.
Method midpoint_method();

/// L_d = h/2 [L(q0, (q1−q0)/h) + L(q1, (q1−q0)/h)], type 1; on a configuration space of its own with the
/// velocity of the chart at q0 (steps/groups/trapezoidal_step.hpp).
Method trapezoidal_method();

/// "typeN/", with which the name of a method of this type begins.
std::string prefix_of(GeneratingType type);

}  // namespace diracstep
