#include <array>
#include <diracstep/core/methods/composition.hpp>
#include <diracstep/core/numerics/errors.hpp>
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
    palindrome<11>({0.21375583945878254555518066964857, 0.18329381407425713911385974425217,
                    0.17692819473098943794898811709929, -0.44329082681170215849622829626258,
                    0.11728560432865935385403585669136, 0.50405474843802736404832781714239});

constexpr auto order8 =
    palindrome<17>({0.13020248308889008088, 0.56116298177510838456, -0.38947496264484728641,
                    0.15884190655515560090, -0.39590389413323757734, 0.18453964097831570709,
                    0.25837438768632204729, 0.29501172360931029887, -0.60550853383003451170});

constexpr auto order10 = palindrome<35>(
    {0.07879572252168641926390768, 0.31309610341510852776481247, 0.02791838323507806610952027,
     -0.22959284159390709415121340, 0.13096206107716486317465686, -0.26973340565451071434460973,
     0.07497334315589143566613711, 0.11199342399981020488957508, 0.36613344954622675119314812,
     -0.39910563013603589787862981, 0.10308739852747107731580277, 0.41143087395589023782070412,
     -0.00486636058313526176219566, -0.39203335370863990644808194, 0.05194250296244964703718290,
     0.05066509075992449633587434, 0.04967437063972987905456880, 0.04931773575959453791768001});

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
    case 10:
      return order10;
    default:
      throw Misuse("no composition of order " + std::to_string(order) + "; the orders are 2, 4, 6, 8, 10");
  }
}

}  // namespace diracstep
