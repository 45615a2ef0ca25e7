#pragma once

#include <cstring>

namespace diracstep {

/// y_i = base_i + Σ_k weights[s i + k] x_k for i, k < s, where x and y are s columns of n numbers; base_i
/// stands i · stride numbers behind base, so that a stride of 0 adds the same column to each sum.  y may be x
/// or base.
using StageSum = void (*)(const double* x, const double* weights, const double* base, int stride, double* y);

/// The function for columns of n numbers and s stages, compiled for these sizes; null above n = 8 or s = 6.
StageSum stage_sum(int n, int s);

namespace detail {

/// Two numbers that the processor adds side by side; four would need a newer one than the build asks for.
using Pair = double __attribute__((vector_size(16)));

/// Those at x, which need not be aligned as a pair is.
inline Pair pair_at(const double* x) {
  Pair pair;
  std::memcpy(&pair, x, sizeof pair);
  return pair;
}

/// The function behind stage_sum().
template <int n, int s>
inline void sum_stages(const double* x, const double* weights, const double* base, int stride, double* y) {
  constexpr int whole = n / 2, pairs = (n + 1) / 2;
  Pair columns[s][pairs], sums[s][pairs];
  for (int k = 0; k < s; ++k) {
    for (int p = 0; p < whole; ++p) columns[k][p] = pair_at(x + k * n + 2 * p);
    if constexpr (n % 2 == 1) columns[k][whole] = Pair{x[k * n + n - 1], 0.0};
  }
#pragma GCC unroll 8
  for (int i = 0; i < s; ++i) {
    const Pair first = {weights[s * i], weights[s * i]};
    for (int p = 0; p < pairs; ++p) sums[i][p] = first * columns[0][p];
#pragma GCC unroll 8
    for (int k = 1; k < s; ++k) {
      const Pair weight = {weights[s * i + k], weights[s * i + k]};
#pragma GCC unroll 8
      for (int p = 0; p < pairs; ++p) sums[i][p] += weight * columns[k][p];
    }
  }
  for (int i = 0; i < s; ++i) {
    for (int p = 0; p < whole; ++p) {
      const Pair sum = pair_at(base + i * stride + 2 * p) + sums[i][p];
      std::memcpy(y + i * n + 2 * p, &sum, sizeof sum);
    }
    if constexpr (n % 2 == 1) y[i * n + n - 1] = base[i * stride + n - 1] + sums[i][whole][0];
  }
}

}  // namespace detail

}  // namespace diracstep
