#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/adaptive/convergence.hpp>

namespace diracstep {
namespace {

/// Adds runs with steps 1, 1/2, 1/4, … whose differences are given.
Convergence after(int order, double error, const std::vector<double>& differences) {
  Convergence convergence(order, error);
  double step = 1.0;
  convergence.add(step, std::nan(""));
  for (const double difference : differences) convergence.add(step *= 0.5, difference);
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

TEST(Convergence, TakesTheErrorOfThreeRunsWhateverTheOrder) {
  EXPECT_TRUE(after(8, 1e-6, {1e-3, 3e-7, 2e-7}).accepted());
  EXPECT_FALSE(after(8, 1e-6, {3e-7}).accepted());
  EXPECT_FALSE(after(8, 1e-6, {1e-3, 3e-7}).accepted());
}

TEST(Convergence, NeverTakesWhatIsNoNumber) {
  EXPECT_FALSE(after(4, 1e-2, {std::nan(""), std::nan(""), std::nan("")}).accepted());
  EXPECT_FALSE(after(4, 1e-2, {1e-9, 1e-9, std::nan("")}).accepted());
}

TEST(Convergence, TakesRunsThatAreEqualWhateverTheStep) {
  EXPECT_TRUE(after(4, 1e-9, {0.0, 0.0}).accepted());
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
