#pragma once

#include <diracstep/core/numerics/types.hpp>

namespace diracstep {

/// The Legendre polynomial P_n at x, |x| < 1.
struct LegendrePoint {
  long double value, derivative;
};
LegendrePoint legendre_polynomial(int n, long double x);

/// Gauss's rule on (0, 1): ∫ f ≈ Σ weight_i f(place_i), exact for polynomials below degree 2 · points.  The
/// places are zeros of the Legendre polynomial by Newton's method (Abramowitz, Stegun 25.4.29).
struct GaussRule {
  ExtendedVector places, weights;
};
GaussRule gauss_rule(int points);

}  // namespace diracstep
