#pragma once

#include <diracstep/core/methods/method.hpp>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace diracstep {

/// Methods by name.  A registry is a value: nothing is global.
///
/// Beside the registered names it knows four families:
///   typeN/gl:S                N = 1, 2, 3: the Gauss–Lobatto Dirac step with S stages, order 2S
///                             (steps/gauss_lobatto/step.hpp); one step, whose generating functions of the
///                             three types are in methods/gauss_lobatto.hpp
///   typeN/legendre(type1/…)   N = 2, 3, 4: the discrete Legendre transform of a method of type 1
///   typeN/adjoint(…)          the adjoint of a method; N is its type
///   damped/radau:S            Radau IIA with S stages, S = 1 … 5, order 2S − 1 (steps/radau/step.hpp), which
///                             damps what is too fast for a step; it has no generating function
class Registry {
 public:
  /// The methods that come with the library.
  static Registry with_built_ins();

  /// Throws Misuse for a name that is taken, or is not of the form typeN/construction with N the type, and
  /// for a method without a type or a step.
  void add(Method method);

  /// The method that steps a generating function: add(method_of(info, generating_function)).
  void add(MethodInfo info, GeneratingFunctionFactory generating_function);

  /// Throws Misuse for an unknown name, listing the known ones.
  Method method(const std::string& name) const;

  /// The adjoint of a method: itself, the one it names, or one made from it.  Throws Misuse for a method of
  /// the damping family, which has no generating function to make it from.
  Method adjoint_of(const Method& method) const;

  /// A rule for Δ^d_Q beside left, right, midpoint and trapezoidal; throws Misuse for a name that is taken.
  void add_rule(const StepRule& rule);

  /// Throws Misuse for an unknown name, listing the known ones.
  StepRule rule(std::string_view name) const;
  const std::vector<StepRule>& rules() const { return rules_; }

  /// Registered names, the Legendre transforms of those of type 1, GL(1) to GL(4), and
  /// damped/radau:1 to damped/radau:4.
  std::vector<std::string> names() const;

 private:
  Method transformed(const std::string& name) const;

  std::map<std::string, Method> methods_;
  std::vector<StepRule> rules_{StepRule::left, StepRule::right, StepRule::midpoint, StepRule::trapezoidal};
};

}  // namespace diracstep
