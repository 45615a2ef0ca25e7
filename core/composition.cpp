#include <array>
#include <diracstep/core/composition.hpp>
#include <diracstep/core/errors.hpp>
#include <string>

namespace diracstep {

namespace {

/// The whole palindrome from its first half and its middle.
template <std::size_t S>
constexpr std::array<double, S> palindrome(const std::array<double, (S + 1) / 2>& half) {
  std::array<double, S> all{};
  for (std::size_t i = 0; i < S; ++i) all[i] = half[i < half.size() ? i : S - 1 - i];
  return all;
}

constexpr std::array<double, 1> order2{1.0};

// γ = 1/(4 − 4^{1/3}), twice at each end, and 1 − 4γ between.
constexpr auto order4 =
    palindrome<5>({0.41449077179437573714, 0.41449077179437573714, -0.65796308717750294857});

constexpr auto order6 =
    palindrome<9>({0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981,
                   0.08221359629355080023, 0.79854399093482996340});

constexpr auto order8 =
    palindrome<17>({0.13020248308889008088, 0.56116298177510838456, -0.38947496264484728641,
                    0.15884190655515560090, -0.39590389413323757734, 0.18453964097831570709,
                    0.25837438768632204729, 0.29501172360931029887, -0.60550853383003451170});

}  // namespace

std::span<const double> composition_fractions(int order) {
  switch (order) {
    case 2:
      return order2;
    case 4:
      return order4;
    case 6:
      return order6;
    case 8:
      return order8;
    default:
      throw Misuse("no composition of order " + std::to_string(order) + "; the orders are 2, 4, 6, 8");
  }
}

}  // namespace diracstep
