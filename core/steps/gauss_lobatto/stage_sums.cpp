#include <array>
#include <diracstep/core/steps/gauss_lobatto/stage_sums.hpp>
#include <utility>

namespace diracstep {

namespace {

constexpr int most_rows = 8, most_stages = 6;

template <int n, int s>
void sum(const double* x, const double* weights, const double* base, int stride, double* y) {
  double columns[s * n];  // y may stand where x or the weights do, for all the compiler knows
  for (int k = 0; k < s * n; ++k) columns[k] = x[k];
#pragma GCC unroll 8
  for (int i = 0; i < s; ++i) {
    double of[n];
#pragma GCC unroll 8
    for (int r = 0; r < n; ++r) of[r] = weights[s * i] * columns[r];
#pragma GCC unroll 8
    for (int k = 1; k < s; ++k)
#pragma GCC unroll 8
      for (int r = 0; r < n; ++r) of[r] += weights[s * i + k] * columns[k * n + r];
#pragma GCC unroll 8
    for (int r = 0; r < n; ++r) y[i * n + r] = base[i * stride + r] + of[r];
  }
}

template <int n, std::size_t... S>
constexpr std::array<StageSum, most_stages> for_stages(std::index_sequence<S...>) {
  return {&sum<n, static_cast<int>(S) + 1>...};
}

template <std::size_t... N>
constexpr auto for_rows(std::index_sequence<N...>) {
  return std::array{for_stages<static_cast<int>(N) + 1>(std::make_index_sequence<most_stages>())...};
}

constexpr auto sums = for_rows(std::make_index_sequence<most_rows>());

}  // namespace

StageSum stage_sum(int n, int s) {
  if (n < 1 || n > most_rows || s < 1 || s > most_stages) return nullptr;
  return sums[static_cast<std::size_t>(n) - 1][static_cast<std::size_t>(s) - 1];
}

}  // namespace diracstep
