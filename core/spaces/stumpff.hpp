#pragma once

#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <diracstep/core/numerics/jet.hpp>

namespace diracstep {

namespace detail {

/// 1/(i (i − 1)) for i from 2 on: what a term of the series is multiplied by.
inline constexpr std::array<double, 50> stumpff_ratios = [] {
  std::array<double, 50> ratios{};
  for (std::size_t i = 2; i < ratios.size(); ++i)
    ratios[i] = 1.0 / (static_cast<double>(i) * (static_cast<double>(i) - 1.0));
  return ratios;
}();

/// Σ_j (−s)^j/(2j+k)!, `terms` of them, from the last to the first.
template <class T>
T stumpff_series(int k, const T& s, int terms) {
  T sum(1.0);
  for (int j = terms; j > 0; --j)
    sum = T(1.0) - s * sum * T(stumpff_ratios[2 * static_cast<std::size_t>(j) + static_cast<std::size_t>(k)]);
  double factorial = 1.0;
  for (int i = 2; i <= k; ++i) factorial *= i;
  return sum * T(1.0 / factorial);
}

inline double real_part(double x) { return x; }
inline double real_part(long double x) { return static_cast<double>(x); }
template <class R>
double real_part(const std::complex<R>& x) {
  return static_cast<double>(x.real());
}

}  // namespace detail

/// Stumpff's functions c_k(s) = Σ_j (−s)^j/(2j+k)!, of which with θ² = s
///
///   c_0 = cos θ,   c_1 = sin θ/θ,   c_2 = (1 − cos θ)/θ²,   c_3 = (θ − sin θ)/θ³,   c_k' = (k c_{k+2} −
///   c_{k+1})/2
///
/// All coefficients of exponentials of rotations are such, and so are their derivatives: none divides by θ.
/// The series is taken up to θ = 4, beyond the injectivity of every exponential here, with terms until they
/// are below round-off; the recurrence c_{k+2} = (1/k! − c_k)/s follows.
template <class T>
T stumpff(int k, const T& s) {
  using std::cos, std::sin, std::sqrt;
  const double size = std::abs(detail::real_part(s));
  if (size < 16.0) return detail::stumpff_series(k, s, size < 1.0 ? 10 : 20);
  const T theta = sqrt(s);
  T value = k % 2 == 0 ? cos(theta) : sin(theta) / theta;
  double factorial = 1.0;
  for (int j = k % 2; j < k; j += 2) {
    value = (T(1.0 / factorial) - value) / s;
    factorial *= (j + 1.0) * (j + 2.0);
  }
  return value;
}

/// c_0 … c_7 at once: the last two by their series, the others by c_k = 1/k! − s c_{k+2}.
inline std::array<double, 8> stumpff_values(double s) {
  std::array<double, 8> c;
  if (!(std::abs(s) < 16.0)) {
    for (int k = 0; k < 8; ++k) c[static_cast<std::size_t>(k)] = stumpff(k, s);
    return c;
  }
  const int terms = std::abs(s) < 1.0 ? 7 : 16;
  c[7] = detail::stumpff_series(7, s, terms);
  c[6] = detail::stumpff_series(6, s, terms);
  c[5] = 1.0 / 120.0 - s * c[7];
  c[4] = 1.0 / 24.0 - s * c[6];
  c[3] = 1.0 / 6.0 - s * c[5];
  c[2] = 0.5 - s * c[4];
  c[1] = 1.0 - s * c[3];
  c[0] = 1.0 - s * c[2];
  return c;
}

/// c_k with first and second derivatives.
template <int N, int Order>
Jet<N, Order> stumpff(int k, const Jet<N, Order>& s) {
  const double x = s.value(), c2 = stumpff(k + 2, x);
  const double first = 0.5 * (k * c2 - stumpff(k + 1, x));
  const double second =
      Order == 1 ? 0.0
                 : 0.25 * (k * (k + 2.0) * stumpff(k + 4, x) - (2.0 * k + 1.0) * stumpff(k + 3, x) + c2);
  return Jet<N, Order>::chain(s, stumpff(k, x), first, second);
}

}  // namespace diracstep
