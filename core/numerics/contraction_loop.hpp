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

/// Repeats correct(), which is x ← x − P⁻¹F, until F is round-off or that is slow.  evaluate() takes F at x
/// and gives its largest entry in units of its block, infinite where one is no number.
template <class Evaluate, class Correct>
inline Contraction contract(const ContractionLimits& limits, Evaluate evaluate, Correct correct) {
  Contraction end;
  const double first = evaluate();
  double norm = first, before = HUGE_VAL;
  while (!detail::contracted(limits, norm, before) &&
         !detail::contracts_too_slowly(limits, norm, before, end.iterations)) {
    correct();
    ++end.iterations;
    before = norm;
    norm = evaluate();
  }
  end.solved = detail::contracted(limits, norm, before);
  // What is left has the same sign in one step after the other, and drives the energy one way: unless it is
  // small beside round-off, a last correction, which is not evaluated any more, makes it so.
  if (end.solved && norm > limits.tolerance / 8.0) correct();
  end.nearer = norm <= first;
  return end;
}

}  // namespace diracstep
