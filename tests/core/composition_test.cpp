#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/composition.hpp>
#include <string>

#include "misuse.hpp"

namespace diracstep {
namespace {

/// Rounding of up to 17 fractions below 1, each to double.
constexpr long double rounding = 17.0L * 0x1p-54L;

long double power_sum(int order, int exponent) {
  long double sum = 0.0L;
  for (const long double fraction : composition_fractions(order)) sum += std::pow(fraction, exponent);
  return sum;
}

TEST(Composition, FractionsSumToOne) {
  for (const int order : {2, 4, 6, 8})
    EXPECT_NEAR(static_cast<double>(power_sum(order, 1) - 1.0L), 0.0, static_cast<double>(rounding)) << order;
}

TEST(Composition, FractionsArePalindromic) {
  for (const int order : {2, 4, 6, 8}) {
    const auto fractions = composition_fractions(order);
    EXPECT_TRUE(std::equal(fractions.begin(), fractions.end(), fractions.rbegin())) << order;
  }
}

TEST(Composition, OddPowerSumsVanishUpToTheOrder) {
  for (const int order : {2, 4, 6, 8}) {
    for (int exponent = 3; exponent < order; exponent += 2) {
      const long double derivative = static_cast<long double>(exponent) * rounding;
      EXPECT_LT(std::abs(power_sum(order, exponent)), derivative) << order << " " << exponent;
    }
    EXPECT_GT(std::abs(power_sum(order, order + 1)), 1e-5L)
        << "order " << order << " would be higher than stated";
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
  for (const int order : {2, 4, 6, 8}) {
    const int steps = order == 8 ? 20 : 60;
    const long double coarse = oscillator_error(order, steps, step),
                      fine = oscillator_error(order, 2 * steps, step);
    EXPECT_GT(fine, 1e-14L) << "order " << order << ": the error is rounding of the fractions";
    EXPECT_NEAR(static_cast<double>(std::log2(coarse / fine)), order, 0.1) << order;
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

TEST(Composition, UnknownOrdersAreRefusedWithTheKnownOnes) {
  for (const int order : {-4, 0, 1, 3, 5, 7, 9, 40})
    testing::expect_misuse([&] { (void)composition_fractions(order); },
                           {"order " + std::to_string(order) + ";", "2, 4, 6, 8"});
}

}  // namespace
}  // namespace diracstep
