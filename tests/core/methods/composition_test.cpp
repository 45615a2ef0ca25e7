#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/methods/composition.hpp>
#include <map>
#include <numeric>
#include <string>
#include <vector>

#include "misuse.hpp"

namespace diracstep {
namespace {

/// Rounding of up to 35 fractions below 1, each to double.
constexpr long double rounding = 35.0L * 0x1p-54L;

long double power_sum(int order, int exponent) {
  long double sum = 0.0L;
  for (const long double fraction : composition_fractions(order)) sum += std::pow(fraction, exponent);
  return sum;
}

TEST(Composition, FractionsSumToOne) {
  for (const int order : composition_orders)
    EXPECT_NEAR(static_cast<double>(power_sum(order, 1) - 1.0L), 0.0, static_cast<double>(rounding)) << order;
}

TEST(Composition, FractionsArePalindromic) {
  for (const int order : composition_orders) {
    const auto fractions = composition_fractions(order);
    EXPECT_TRUE(std::equal(fractions.begin(), fractions.end(), fractions.rbegin())) << order;
  }
}

TEST(Composition, OddPowerSumsVanishUpToTheOrder) {
  for (const int order : composition_orders) {
    for (int exponent = 3; exponent < order; exponent += 2) {
      const long double derivative = static_cast<long double>(exponent) * rounding;
      EXPECT_LT(std::abs(power_sum(order, exponent)), derivative) << order << " " << exponent;
    }
  }
}

/// A product of exponentials of γ Y_1 + γ³ Y_3 + γ⁵ Y_5 + …, the step that is to be composed: its
/// coefficients of the words in the letters Y_1, Y_3, Y_5, … of a degree up to `degree`, Y_k being of degree
/// k.
using Word = std::vector<int>;
using Series = std::map<Word, long double>;

void add_words(Series& series, const Word& word, int degree_left) {
  series[word] = word.empty() ? 1.0L : 0.0L;
  for (int letter = 1; letter <= degree_left; letter += 2) {
    Word longer = word;
    longer.push_back(letter);
    add_words(series, longer, degree_left - letter);
  }
}

/// series · exp(γ Y_1 + γ³ Y_3 + …)
Series followed_by(const Series& series, long double fraction) {
  Series product;
  for (const auto& [word, unused] : series) {
    long double factor = 1.0L;
    for (std::size_t cut = word.size() + 1; cut-- > 0;) {
      product[word] +=
          series.at(Word(word.begin(), word.begin() + static_cast<std::ptrdiff_t>(cut))) * factor;
      if (cut == 0) break;
      factor *= std::pow(fraction, word[cut - 1]) / static_cast<long double>(word.size() - cut + 1);
    }
  }
  return product;
}

/// Largest difference of the coefficients of one degree from those of exp(Y_1).
long double order_residual(const Series& series, int degree) {
  long double largest = 0.0L;
  for (const auto& [word, coefficient] : series) {
    if (std::accumulate(word.begin(), word.end(), 0) != degree) continue;
    const bool in_exponential = std::ranges::all_of(word, [](int letter) { return letter == 1; });
    const long double expected = in_exponential ? 1.0L / std::tgamma(word.size() + 1.0L) : 0.0L;
    largest = std::max(largest, std::abs(coefficient - expected));
  }
  return largest;
}

/// Every order condition (Hairer, Lubich, Wanner, III.3, in the free algebra): a composition is of order p
/// exactly if the product agrees with exp(Y_1) up to degree p.
TEST(Composition, EveryOrderConditionHoldsAndThoseOfTheNextOrderDoNot) {
  for (const int order : composition_orders) {
    Series series;
    add_words(series, {}, order + 1);
    for (const double fraction : composition_fractions(order)) series = followed_by(series, fraction);
    for (int degree = 1; degree <= order; ++degree)
      EXPECT_LT(order_residual(series, degree), rounding) << order << " " << degree;
    EXPECT_GT(order_residual(series, order + 1), 1e-7L) << order << " would be higher than stated";
  }
}

/// q'' = −q from (1, 0) to t = 6, in extended precision; maximum error of (q, p).
template <class Step>
long double oscillator_error(int order, int steps, Step step) {
  const long double h = 6.0L / steps;
  std::array<long double, 2> z{1.0L, 0.0L};
  for (int k = 0; k < steps; ++k)
    for (const long double fraction : composition_fractions(order)) step(fraction * h, z[0], z[1]);
  return std::max(std::abs(z[0] - std::cos(6.0L)), std::abs(z[1] + std::sin(6.0L)));
}

template <class Step>
void expect_stated_orders(Step step) {
  for (const int order : composition_orders) {
    const int steps = order == 10 ? 5 : order == 8 ? 20 : 60;
    const long double coarse = oscillator_error(order, steps, step),
                      fine = oscillator_error(order, 2 * steps, step);
    EXPECT_GT(fine, 1e-14L) << "order " << order << ": the error is rounding of the fractions";
    EXPECT_NEAR(static_cast<double>(std::log2(coarse / fine)), order, order == 10 ? 0.4 : 0.15) << order;
  }
}

/// All its stages commute, so the power sums alone decide.
TEST(Composition, MidpointOscillatorHasTheStatedOrder) {
  expect_stated_orders([](long double h, long double& q, long double& p) {
    const long double a = 1.0L + h * h / 4.0L, c = (1.0L - h * h / 4.0L) / a, s = h / a;
    const long double q0 = q;
    q = c * q0 + s * p;
    p = c * p - s * q0;
  });
}

/// Its stages do not commute, so every order condition counts.
TEST(Composition, VerletOscillatorHasTheStatedOrder) {
  expect_stated_orders([](long double h, long double& q, long double& p) {
    p -= h / 2.0L * q;
    q += h * p;
    p -= h / 2.0L * q;
  });
}

/// The Hénon–Heiles system from (0.3, 0.2), (0.3, −0.1) to t = 30 with the leapfrog step.
std::array<long double, 4> henon_heiles(int order, int steps) {
  std::array<long double, 4> z{0.3L, 0.2L, 0.3L, -0.1L};
  const auto kick = [&z](long double h) {
    z[2] -= h * (z[0] + 2.0L * z[0] * z[1]);
    z[3] -= h * (z[1] + z[0] * z[0] - z[1] * z[1]);
  };
  for (int k = 0; k < steps; ++k)
    for (const long double fraction : composition_fractions(order)) {
      const long double h = fraction * 30.0L / steps;
      kick(h / 2.0L);
      z[0] += h * z[2];
      z[1] += h * z[3];
      kick(h / 2.0L);
    }
  return z;
}

/// In extended precision, since the error of order 10 is below round-off of double before it is asymptotic.
TEST(Composition, HasTheStatedOrderOnANonlinearSystem) {
  const auto reference = henon_heiles(10, 1500);
  const std::map<int, int> steps{{2, 4000}, {4, 1000}, {6, 300}, {8, 150}, {10, 90}};
  for (const auto& [order, coarse] : steps) {
    const auto error = [&, p = order](int count) {
      const auto z = henon_heiles(p, count);
      long double largest = 0.0L;
      for (std::size_t i = 0; i < z.size(); ++i) largest = std::max(largest, std::abs(z[i] - reference[i]));
      return largest;
    };
    EXPECT_NEAR(static_cast<double>(std::log2(error(coarse) / error(2 * coarse))), order, 0.2)
        << order << " " << error(coarse) << " " << error(2 * coarse);
  }
}

TEST(Composition, UnknownOrdersAreRefusedWithTheKnownOnes) {
  for (const int order : {-4, 0, 1, 3, 5, 7, 9, 40})
    testing::expect_misuse([&] { (void)composition_fractions(order); },
                           {"order " + std::to_string(order) + ";", "2, 4, 6, 8, 10"});
}

}  // namespace
}  // namespace diracstep
