#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/adaptive/pointwise_motion.hpp>
#include <diracstep/core/adaptive/rate_monitor.hpp>
#include <diracstep/core/integrator/integrator.hpp>

#include "scenes.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

/// The motion of a scene at a time of either sign, to round-off.
Sample motion_at(const std::shared_ptr<const Scene>& scene, double t) {
  return testing::samples_of(scene, {.method = "type1/gl:4", .step = t}, 1).back();
}

/// d(ln ω)/dt at the start by differences along the motion itself.
double true_growth(const std::shared_ptr<const Scene>& scene, RateMeter& meter, double step) {
  const double tau = 1e-3;
  double logs[2];
  for (int side = 0; side < 2; ++side) {
    const Sample sample = motion_at(scene, side == 0 ? -tau : tau);
    const Rate rate = meter.rate(sample.time, sample.q, sample.v, step);
    EXPECT_TRUE(rate.ok()) << rate.failure;
    logs[side] = std::log(rate.rate);
  }
  return (logs[1] - logs[0]) / (2.0 * tau);
}

TEST(RateMeter, GrowthIsThatAlongTheMotion) {
  const Monitor own{
      [](double, ConstVectorRef q, ConstVectorRef v) { return 1.0 + q.squaredNorm() + v.squaredNorm(); }};
  for (const auto& plain : testing::every_constraint_class())
    for (const auto& scene : {plain, testing::forced(plain)})
      for (const Monitor& monitor : {Monitor{}, own}) {
        RateMeter meter(*scene, kinsol(), monitor, {1.0, 0.3});
        const double step = 0.2;
        const Rate rate = meter.rate_and_growth(0.0, scene->start.q, scene->start.v, step);
        ASSERT_TRUE(rate.ok()) << rate.failure;
        // Differences over 1e-3 on both sides are good to about 1e-6.
        EXPECT_NEAR(rate.growth, true_growth(scene, meter, step), 2e-5) << scene->name;
        EXPECT_NEAR(rate.rate, meter.rate(0.0, scene->start.q, scene->start.v, step).rate, 1e-12 * rate.rate);
      }
}

TEST(RateMeter, RateIsEvenAndGrowthOddInTheVelocity) {
  for (const auto& scene : testing::every_constraint_class()) {
    RateMeter meter(*scene, kinsol(), {}, {1.0, 0.3});
    const Rate there = meter.rate_and_growth(0.0, scene->start.q, scene->start.v, 0.2);
    const Rate back = meter.rate_and_growth(0.0, scene->start.q, -scene->start.v, 0.2);
    EXPECT_NEAR(there.rate, back.rate, 1e-11 * there.rate) << scene->name;
    EXPECT_NEAR(there.growth, -back.growth, 1e-8 * std::abs(there.growth)) << scene->name;
  }
}

TEST(PointwiseMotion, FullAndSparseSystemsAgree) {
  const auto scene = testing::mixed();
  PointwiseMotion full(*scene, kinsol()), sparse(*scene, kinsol(), 0);
  Vector a(3), b(3);
  ASSERT_TRUE(full.acceleration(0.0, scene->start.q, scene->start.v, a).ok());
  ASSERT_TRUE(sparse.acceleration(0.0, scene->start.q, scene->start.v, b).ok());
  EXPECT_LT((a - b).lpNorm<Eigen::Infinity>(), 1e-13);
  EXPECT_GT(a.norm(), 0.1);
}

}  // namespace
}  // namespace diracstep
