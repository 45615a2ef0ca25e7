#pragma once

#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/dirac/step_rule.hpp>
#include <diracstep/core/steps/step_problem.hpp>
#include <diracstep/core/system/scene.hpp>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace diracstep {

/// What is stated of a method, and what an integrator needs to know to use it.
struct MethodInfo {
  std::string name;           ///< "type1/midpoint"
  GeneratingType type;        ///< the type of its generating function
  int order;                  ///< stated order in q and in projected p
  bool self_adjoint;          ///< Φ_{−h} = Φ_h⁻¹
  StepRule constraint_rule;   ///< the rule for Δ^d_Q that keeps its order
  std::string summary;        ///< its formula in a line
  std::string adjoint = {};   ///< the method that is its adjoint, if there is one by name; else one is made
  int constrained_order = 0;  ///< stated order on scenes with rows or a force; 0: the same
  bool allocation_free = false;  ///< it states that evaluating it allocates no memory
};

/// Makes the generating function of a method for a scene that has a Lagrangian; throws Misuse where the scene
/// lacks what the method needs.
using GeneratingFunctionFactory = std::function<std::unique_ptr<GeneratingFunction>(const Scene&)>;

/// Makes the step of a method that has one of its own.
using StepFactory = std::function<std::unique_ptr<StepProblem>(const Scene&, bool dense)>;

/// A method ready for use.
struct Method {
  MethodInfo info;
  GeneratingFunctionFactory make;  ///< its generating function; empty where it has none
  StepFactory make_step = {};      ///< a step of its own; empty where it is that of the generating function
  int stages = 0;                  ///< S for a step GL(S); 0 for others
  /// The rows hold at nodes inside the step: `make` is its generating function on scenes without rows and
  /// forces; with them only `make_step` is the step.
  bool rows_inside = false;

  /// The step on a scene, with the method's own rule for Δ^d_Q or another.  Throws Misuse for another rule
  /// where the rows of the method hold inside the step, and for a degenerate scene (a Lagrangian linear in v)
  /// where the method is not one of the Gauss-Lobatto family, unless `force_degenerate`:
  /// one-sided and trapezoidal rules are unstable there.
  std::unique_ptr<StepProblem> step(const Scene& scene, bool dense, std::optional<ConstraintRule> rule = {},
                                    bool force_degenerate = false) const;
};

/// Methods by name.  A registry is a value: nothing is global.
///
/// Beside the registered names it knows three families:
///   typeN/gl:S                N = 1, 2, 3: the Gauss–Lobatto Dirac step with S stages, order 2S
///                             (gauss_lobatto_step.hpp); one step, whose generating functions of the three
///                             types are in generating_functions/gauss_lobatto.hpp
///   typeN/legendre(type1/…)   N = 2, 3, 4: the discrete Legendre transform of a method of type 1
///   typeN/adjoint(…)          the adjoint of a method; N is its type
class Registry {
 public:
  /// The methods that come with the library.
  static Registry with_built_ins();

  /// Throws Misuse for a name that is taken, or is not of the form typeN/construction with N the type.
  /// `make_step`, where given, must solve the step of the generating function; it may do so in other
  /// unknowns, as GL(`stages`) does.
  void add(MethodInfo info, GeneratingFunctionFactory make, StepFactory make_step = {}, int stages = 0);

  /// Throws Misuse for an unknown name, listing the known ones.
  Method method(const std::string& name) const;

  /// The adjoint of a method: itself, the one it names, or one made from it.
  Method adjoint_of(const Method& method) const;

  /// A rule for Δ^d_Q beside left, right, midpoint and trapezoidal; throws Misuse for a name that is taken.
  void add_rule(const StepRule& rule);

  /// Throws Misuse for an unknown name, listing the known ones.
  StepRule rule(std::string_view name) const;
  const std::vector<StepRule>& rules() const { return rules_; }

  /// Registered names, the Legendre transforms of those of type 1, and GL(1) to GL(4).
  std::vector<std::string> names() const;

 private:
  Method transformed(const std::string& name) const;

  std::map<std::string, Method> methods_;
  std::vector<StepRule> rules_{StepRule::left, StepRule::right, StepRule::midpoint, StepRule::trapezoidal};
};

}  // namespace diracstep
