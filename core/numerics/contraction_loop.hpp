#pragma once

#include <cmath>
#include <diracstep/core/numerics/contraction.hpp>

namespace diracstep {

/// A residual of so many tolerances is round-off.
constexpr double round_off_in_tolerances = 16.0;

namespace detail {

/// A residual below the tolerance, or round-off that no longer falls.
inline bool contracted(const ContractionLimits& limits, double norm, double before) {
  return norm <= limits.tolerance ||
         (norm > before / 2.0 && norm <= round_off_in_tolerances * limits.tolerance);
}

/// Whether the iteration diverges, or at its rate takes too many iterations; a single rate says little.
inline bool contracts_too_slowly(const ContractionLimits& limits, double norm, double before, int count) {
  constexpr double quick = 0.2;
  if (!std::isfinite(norm)) return true;
  if (count < 2) return norm > 2.0 * before;
  const double rate = norm / before;
  if (rate < quick && count < limits.max_iterations) return false;
  if (rate >= 1.0) return true;
  double expected = norm;
  for (int k = count; k < limits.max_iterations && expected > limits.tolerance; ++k) expected *= rate;
  return expected > limits.tolerance;
}

}  // namespace detail

/// What follows in an iteration x ← x − P⁻¹F each time that F has been evaluated.
class ContractionSteps {
 public:
  enum class Next { stop, correct, correct_and_stop };

  explicit ContractionSteps(const ContractionLimits& limits) : limits_(limits) {}

  /// `norm`: the largest entry of F in units of its block, infinite where one is no number.
  Next after(double norm) {
    if (std::isnan(first_)) first_ = norm;
    end_.nearer = norm <= first_;
    end_.solved = detail::contracted(limits_, norm, before_);
    // What is left has the same sign in one step after the other, and drives the energy one way: unless it is
    // small beside round-off, a last correction, which is not evaluated any more, makes it so.
    if (end_.solved) return norm > limits_.tolerance / 8.0 ? Next::correct_and_stop : Next::stop;
    if (detail::contracts_too_slowly(limits_, norm, before_, end_.iterations)) return Next::stop;
    ++end_.iterations;
    before_ = norm;
    return Next::correct;
  }

  /// How it ended, but for the norms.
  const Contraction& end() const { return end_; }

 private:
  ContractionLimits limits_;
  Contraction end_;
  double first_ = NAN, before_ = HUGE_VAL;
};

/// Repeats correct(), which is x ← x − P⁻¹F, until F is round-off or that is slow.  evaluate() takes F at x
/// and gives its norm as ContractionSteps takes it.
template <class Evaluate, class Correct>
inline Contraction contract(const ContractionLimits& limits, Evaluate evaluate, Correct correct) {
  using Next = ContractionSteps::Next;
  ContractionSteps steps(limits);
  Next next = steps.after(evaluate());
  for (; next == Next::correct; next = steps.after(evaluate())) correct();
  if (next == Next::correct_and_stop) correct();
  return steps.end();
}

}  // namespace diracstep
