#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/adaptive/convergence.hpp>

namespace diracstep {
namespace {

constexpr double round_off = 1e-15;

/// Adds runs with steps 1, 1/2, 1/4, … whose differences are given.
Convergence after(int order, double error, const std::vector<double>& differences) {
  Convergence convergence(order, error);
  double step = 1.0;
  convergence.add(step, std::nan(""), round_off);
  for (const double difference : differences) convergence.add(step *= 0.5, difference, round_off);
  return convergence;
}

TEST(Convergence, TakesTwoObservedOrdersThatAgreeWithTheStatedOne) {
  const Convergence convergence = after(4, 1e-5, {1.6e-1, 1e-2, 6.25e-4});
  EXPECT_NEAR(convergence.observed_order(), 4.0, 0.01);
  EXPECT_NEAR(convergence.estimate(), 6.25e-4 / 15.0, 1e-8);
  EXPECT_FALSE(convergence.accepted());
  EXPECT_TRUE(after(4, 2e-4, {1.6e-1, 1e-2, 6.25e-4}).accepted());
}

TEST(Convergence, DoesNotTakeOneAgreement) {
  // Orders 0 and then 5.6: the coarse runs are alike by chance.
  const Convergence convergence = after(6, 1e-1, {3.7e-1, 3.7e-1, 8e-3});
  EXPECT_NEAR(convergence.observed_order(), 5.5, 0.1);
  EXPECT_LT(convergence.estimate(), 4e-2);
  EXPECT_FALSE(convergence.accepted());
}

TEST(Convergence, TakesTheErrorOfThreeRunsWhoseDifferencesFall) {
  EXPECT_TRUE(after(8, 1e-6, {1e-3, 3e-7, 1e-7}).accepted()) << "order 1.6";
  EXPECT_FALSE(after(8, 1e-6, {3e-7}).accepted());
  EXPECT_FALSE(after(8, 1e-6, {1e-3, 3e-7}).accepted());
}

TEST(Convergence, RunsOfNearlyTheSameStepsAgreeForNoReason) {
  const auto after_steps_of = [](double ratio) {
    Convergence convergence(2, 1e-3);
    convergence.add(1.0, std::nan(""), round_off);
    convergence.add(ratio, 3e-4, round_off);
    convergence.add(ratio * ratio, 3e-4 * std::pow(ratio, 1.5), round_off);
    return convergence;
  };
  EXPECT_TRUE(after_steps_of(0.5).accepted());
  EXPECT_FALSE(after_steps_of(0.9).accepted()) << "the error of these runs may be 3e-3";
}

/// y(h) = h^4: runs of sizes 1, 1/4 and, put between the two later, 1/2.
TEST(Convergence, ARunBetweenTwoTellsTheOrderAsAFinerOneDoes) {
  Convergence convergence(4, 1e-2);
  convergence.add(1.0, std::nan(""), round_off);
  convergence.add(0.25, 1.0 - 1.0 / 256.0, round_off);
  EXPECT_TRUE(std::isnan(convergence.observed_order()));
  convergence.insert(1, 0.5, 1.0 - 1.0 / 16.0, 1.0 / 16.0 - 1.0 / 256.0);
  EXPECT_EQ(convergence.runs(), 3u);
  EXPECT_NEAR(convergence.observed_order(), 4.0, 1e-6);
  EXPECT_NEAR(convergence.estimate(), 1.0 / 256.0, 1e-12);
  EXPECT_FALSE(convergence.accepted()) << "one order alone";
  EXPECT_EQ(convergence.confirmed_by_run_before(), 2u) << "between the coarser two it is cheaper";
  const auto power = [](double size) { return size * size * size * size; };
  const double middle = std::sqrt(0.5);
  convergence.insert(2, middle, 1.0 - power(middle), power(middle) - power(0.5));
  EXPECT_TRUE(convergence.order_confirmed());
  EXPECT_TRUE(convergence.accepted());
}

TEST(Convergence, ARunBeforeConfirmsOnlyWhatIsGoodEnough) {
  EXPECT_EQ(after(4, 1e-5, {1.6e-1, 1e-2}).confirmed_by_run_before(), 0u) << "the last run is too coarse";
  EXPECT_EQ(after(4, 1e-2, {1e-4}).confirmed_by_run_before(), 1u);
  EXPECT_EQ(after(8, 1e-2, {3.7e-1, 8e-3}).confirmed_by_run_before(), 0u) << "the order is another";
  EXPECT_EQ(after(4, 1e-2, {std::nan("")}).confirmed_by_run_before(), 0u);
}

TEST(Convergence, NeverTakesWhatIsNoNumber) {
  EXPECT_FALSE(after(4, 1e-2, {std::nan(""), std::nan(""), std::nan("")}).accepted());
  EXPECT_FALSE(after(4, 1e-2, {1e-9, 1e-9, std::nan("")}).accepted());
}

/// An order of 0 says that finer steps bring nothing: the error is not known to be near the difference.
TEST(Convergence, EqualDifferencesAboveRoundOffAreNotBelieved) {
  EXPECT_FALSE(after(8, 1e-6, {1e-3, 3e-7, 3e-7}).accepted());
  EXPECT_FALSE(after(8, 1e-6, {3e-7, 3e-7}).accepted());
  EXPECT_FALSE(after(8, 1e-6, {0.0, 3e-9}).accepted());
  EXPECT_TRUE(after(8, 1e-6, {1e-3, 3e-7, 3e-7, 3e-9}).accepted());
}

/// A mass matrix of ratio 1e-13: differences of 3.98e-7 and 3.09e-7, whose estimate is 1.6e-6.
TEST(Convergence, AnEstimateAboveTheErrorIsNotAccepted) {
  Convergence convergence(8, 1e-6);
  convergence.add(1.0, std::nan(""), round_off);
  convergence.add(0.7, 3.98e-7, round_off);
  convergence.add(0.49, 3.09e-7, round_off);
  EXPECT_GT(convergence.estimate(), 4e-7);
  EXPECT_FALSE(convergence.accepted());
}

TEST(Convergence, RunsThatAreEqualToRoundOffAreBelievedAndSayWhy) {
  const Convergence exact = after(4, 1e-9, {2e-15, 3e-15}), same = after(4, 1e-9, {0.0, 0.0}),
                    converged = after(4, 1e-9, {1e-10, 2e-15, 3e-15});
  EXPECT_TRUE(exact.accepted());
  EXPECT_TRUE(same.accepted());
  EXPECT_NE(exact.grounds().find("round-off, by which already the coarsest of the runs differ"),
            std::string::npos);
  EXPECT_NE(same.grounds().find("round-off, by which already the coarsest of the runs differ"),
            std::string::npos);
  EXPECT_TRUE(converged.accepted());
  EXPECT_NE(converged.grounds().find("round-off, to which the runs have come"), std::string::npos);
  EXPECT_EQ(after(4, 1e-3, {1.6e-1, 1e-2, 6.25e-4, 3.9e-5}).grounds(), "observed order 4.0");
}

/// Of steps by their local error: the last difference of a ring modulator showed a fast phase that was not
/// followed yet, after others that fell by the stated order.
TEST(Convergence, WithoutExtrapolationTheWholeDifferenceCounts) {
  const std::vector<double> differences{5.2e-3, 1.63e-4, 5.1e-6};
  EXPECT_TRUE(after(5, 1e-6, differences).accepted());
  Convergence whole(5, 1e-6, false);
  whole.add(1.0, std::nan(""), round_off);
  for (std::size_t k = 0; k < differences.size(); ++k)
    whole.add(std::ldexp(1.0, -static_cast<int>(k) - 1), differences[k], round_off);
  EXPECT_EQ(whole.estimate(), 5.1e-6);
  EXPECT_FALSE(whole.accepted());
}

TEST(Convergence, RoundOffThatIsAmplifiedIsBelievedAtTenTimesItsSize) {
  const std::vector<double> noise{1e-3, 2e-9, 1.5e-9, 2.2e-9, 1.9e-9};
  EXPECT_TRUE(after(8, 1e-6, noise).accepted());
  EXPECT_NEAR(after(8, 1e-6, noise).estimate(), 2.2e-8, 1e-12);
  EXPECT_NE(after(8, 1e-6, noise).grounds().find("round-off, amplified"), std::string::npos);
  EXPECT_FALSE(after(8, 1e-8, noise).accepted());
}

TEST(Convergence, EstimatesByTheOrderObservedWhereItFallsShort) {
  const Convergence convergence = after(8, 1e-9, {4e-3, 2e-3, 1e-3});
  EXPECT_NEAR(convergence.observed_order(), 1.0, 1e-6);
  EXPECT_NEAR(convergence.estimate(), 1e-3, 1e-8);
  EXPECT_NE(convergence.obstacle().find("not smooth"), std::string::npos) << convergence.obstacle();
}

TEST(Convergence, LaysDifferencesThatStopFallingNearZeroToRoundOff) {
  const Convergence convergence = after(4, 1e-16, {1e-10, 1e-14, 1.1e-14, 0.9e-14, 1e-14});
  EXPECT_TRUE(convergence.stagnates());
  EXPECT_NE(convergence.obstacle().find("round-off"), std::string::npos);
}

TEST(Convergence, ThePrognosisIsThatOfTheBetterOfTwoOrders) {
  // Orders 0 and then 5.6: the first runs did not resolve the motion.
  EXPECT_LT(after(6, 1e-2, {3.7e-1, 3.7e-1, 8e-3}).work_to_go(), 2.0);
  EXPECT_GT(after(6, 1e-2, {3.7e-1, 3.7e-1, 3.6e-1}).work_to_go(), 1e3);
}

}  // namespace
}  // namespace diracstep
