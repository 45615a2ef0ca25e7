#include <cmath>
#include <diracstep/core/numerics/gauss_rule.hpp>
#include <numbers>

namespace diracstep {

LegendrePoint legendre_polynomial(int n, long double x) {
  long double before = 1.0L, value = n == 0 ? 1.0L : x;
  for (int k = 2; k <= n; ++k) {
    const long double next = ((2 * k - 1) * x * value - (k - 1) * before) / k;
    before = value;
    value = next;
  }
  return {value, n * (before - x * value) / (1.0L - x * x)};
}

GaussRule gauss_rule(int points) {
  GaussRule rule{ExtendedVector(points), ExtendedVector(points)};
  for (int i = 0; i < points; ++i) {
    long double x = -std::cos(std::numbers::pi_v<long double> * (i + 0.75L) / (points + 0.5L));
    for (int k = 0; k < 100; ++k) {
      const LegendrePoint p = legendre_polynomial(points, x);
      const long double change = p.value / p.derivative;
      x -= change;
      if (std::abs(change) < 1e-20L) break;
    }
    rule.places[i] = (1.0L + x) / 2.0L;
    const long double at = 2.0L * rule.places[i] - 1.0L, slope = legendre_polynomial(points, at).derivative;
    rule.weights[i] = 1.0L / ((1.0L - at * at) * slope * slope);
  }
  return rule;
}

}  // namespace diracstep
