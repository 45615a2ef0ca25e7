#pragma once

#include <diracstep/validation/laws/conformance.hpp>
#include <functional>
#include <string>
#include <vector>

/// The conformance table of a method, built in or from a plugin: what it claims and what every method must
/// do, measured.
namespace diracstep {

/// One line of the table.
struct Check {
  enum class Result { pass, fail, not_applicable };
  std::string name;  ///< "gradient", "order, holonomic", …
  Result result;
  double figure = 0.0;  ///< what was measured; NaN where there is no number
  double limit = 0.0;   ///< what it was held to; NaN where there is none
  std::string detail;   ///< what the figure is, or why the check failed or does not apply
};

/// All lines of a method or a rule.
struct ConformanceTable {
  std::string subject;  ///< the name of the method or rule
  std::vector<Check> checks;

  bool passed() const;
};

/// What a check may use, and who is told of its progress.
struct CheckOptions {
  /// Heap allocations of this program so far; without it the claim to allocate nothing is not looked at.
  std::function<long()> allocations = {};
  /// Called before each check with its name; false leaves it out.
  std::function<bool(const std::string&)> proceed = {};
};

/// All checks on a method, on the scenes of law_scenes.hpp:
///
///   gradient          first derivatives of S against differences of S
///   hessian           second derivatives against differences of the first; symmetry; nothing off the pattern
///   symplecticity     MᵀΩM = Ω for the Jacobian M of a step without rows
///   consistency       the error of one step falls faster than h
///   order, CLASS      measured within 0.2 of the claimed one, on every class of order_scenes()
///   self-adjointness  where claimed: Φ_{−h}(Φ_h(y)) = y
///   stated step       the step is that of the generating function, where no row acts inside the step
///   membership        every step lies in D_{d+} and D_{d−}, with rows inside the step in its stage space
///   holonomic rows    φ(q_k) = 0 along a run
///   nonholonomic rows the velocities read lie in Δ_Q along a run
///   allocation        where claimed: evaluating S allocates nothing
///   two instances     used in turn, one inside the other and on two threads they give the same bits as alone
///   not a number      NaN is handed on, ends a run with a report, and leaves nothing behind
///
/// `scenes` are those of order_scenes(), which take a moment to make.  An exception in a check is a failure
/// of that check.  Throws Misuse for an unknown method.
ConformanceTable check_method(const Registry& registry, const std::string& method,
                              const std::vector<OrderScene>& scenes, const CheckOptions& options = {});

/// A constraint rule of a registry: order 2 with type1/midpoint where Σ w c = 1/2, else order 1, on the
/// nonholonomic class.
ConformanceTable check_rule(const Registry& registry, const std::string& rule,
                            const std::vector<OrderScene>& scenes);

}  // namespace diracstep
