#include <array>
#include <diracstep/core/steps/gauss_lobatto/stage_sums.hpp>
#include <utility>

namespace diracstep {

namespace {

constexpr int most_rows = 8, most_stages = 6;

template <int n, std::size_t... S>
constexpr std::array<StageSum, most_stages> for_stages(std::index_sequence<S...>) {
  return {&detail::sum_stages<n, static_cast<int>(S) + 1>...};
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
