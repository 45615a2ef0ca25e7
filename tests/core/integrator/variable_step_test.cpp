#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>

#include "misuse.hpp"
#include "scenes.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::expect_misuse;
using testing::samples_of;

Integrator make(const std::shared_ptr<const Scene>& scene, const IntegratorOptions& options) {
  return {scene, Registry::with_built_ins(), kinsol(), options};
}

TEST(VariableStep, OfTheOptionsSizeIsThePlainStepBitByBit) {
  for (const auto& scene : testing::every_constraint_class()) {
    Integrator plain = make(scene, {.method = "type1/gl:2", .step = 0.1});
    Integrator sized = make(scene, {.method = "type1/gl:2", .step = 0.1});
    for (int k = 0; k < 10; ++k) {
      ASSERT_TRUE(plain.step().ok());
      ASSERT_TRUE(sized.step(0.1).ok());
    }
    EXPECT_EQ(plain.position(), sized.position());
    EXPECT_EQ(plain.time(), sized.time());
  }
}

TEST(VariableStep, BackAndForthReturns) {
  for (const auto& scene : testing::every_constraint_class()) {
    Integrator integrator = make(scene, {.method = "type1/gl:3", .step = 0.1});
    for (const double h : {0.1, 0.25, 0.07, -0.07, -0.25, -0.1}) ASSERT_TRUE(integrator.step(h).ok());
    EXPECT_LT((integrator.position() - scene->start.q).lpNorm<Eigen::Infinity>(), 1e-13) << scene->name;
    EXPECT_NEAR(integrator.time(), 0.0, 1e-16);
  }
}

TEST(VariableStep, TheTimeIsTheSumOfTheStepsWithoutRoundOff) {
  Integrator integrator = make(testing::unconstrained(), {.method = "type1/midpoint", .step = 0.1});
  long double sum = 0.0L;
  for (int k = 0; k < 20000; ++k) {
    const double h = 1e-3 * (1.0 + 0.3 * std::sin(0.1 * k));
    ASSERT_TRUE(integrator.step(h).ok());
    sum += h;
  }
  EXPECT_NEAR(integrator.time(), static_cast<double>(sum), 4e-15);  // an ulp; plain sums lose some 1e-13
}

TEST(VariableStep, RetryIsTheSameStepWithAnotherSize) {
  for (const auto& scene : testing::every_constraint_class())
    for (const int order : {0, 4}) {
      const IntegratorOptions options{.method = "type1/midpoint", .order = order, .step = 0.1};
      Integrator retried = make(scene, options), straight = make(scene, options);
      for (const double h : {0.1, 0.12}) {
        ASSERT_TRUE(retried.step(h).ok());
        ASSERT_TRUE(straight.step(h).ok());
      }
      ASSERT_TRUE(retried.step(0.3).ok());
      ASSERT_TRUE(retried.retry(0.2).ok());
      ASSERT_TRUE(retried.retry(0.11).ok());
      ASSERT_TRUE(straight.step(0.11).ok());
      EXPECT_EQ(retried.time(), straight.time());
      EXPECT_EQ(retried.work().steps, 3);
      EXPECT_LT((retried.position() - straight.position()).lpNorm<Eigen::Infinity>(), 1e-14) << scene->name;
      EXPECT_LT((retried.momentum() - straight.momentum()).lpNorm<Eigen::Infinity>(), 1e-13) << scene->name;
    }
}

TEST(VariableStep, RestartGoesOnFromAnyPoint) {
  const auto scene = testing::mixed();
  Integrator there = make(scene, {.method = "type1/gl:3", .step = 0.1}), here = make(scene, there.options());
  for (int k = 0; k < 5; ++k) ASSERT_TRUE(there.step().ok());
  here.restart(there.time(), there.position(), there.momentum(), there.velocity_estimate());
  ASSERT_TRUE(there.step().ok());
  ASSERT_TRUE(here.step().ok());
  EXPECT_DOUBLE_EQ(here.time(), there.time());
  EXPECT_LT((here.position() - there.position()).lpNorm<Eigen::Infinity>(), 1e-14);
}

TEST(VariableStep, RefusesMisuse) {
  Integrator integrator = make(testing::mixed(), {.method = "type1/gl:2", .step = 0.1});
  EXPECT_THROW((void)integrator.step(0.0), Misuse);
  EXPECT_THROW((void)integrator.step(std::nan("")), Misuse);
  expect_misuse([&] { (void)integrator.retry(0.1); }, {"retry", "no step"});
  const Vector q = integrator.position(), wrong = Vector::Zero(2);
  expect_misuse([&] { integrator.restart(0.0, wrong, q, q); }, {"q", "2", "3"});
  expect_misuse([&] { integrator.restart(std::nan(""), q, q, q); }, {"not finite"});
}

TEST(CompensatedSums, AreTheSameStepUpToRoundOff) {
  for (const auto& plain : testing::every_constraint_class())
    for (const auto& scene : {plain, testing::forced(plain)})
      for (const char* method : {"type1/gl:1", "type1/gl:3"}) {
        const Sample rounded = samples_of(scene, {.method = method, .step = 0.1}, 20).back();
        const Sample exact =
            samples_of(scene, {.method = method, .step = 0.1, .compensated_sums = true}, 20).back();
        EXPECT_LT((rounded.q - exact.q).lpNorm<Eigen::Infinity>(), 1e-13) << scene->name;
        EXPECT_LT((rounded.p - exact.p).lpNorm<Eigen::Infinity>(), 1e-13) << scene->name;
      }
}

/// A contact oscillator with an energy of order 1, as in McLachlan and Perlmutter 2006, example 5.2.
std::shared_ptr<const Scene> contact_oscillator() {
  Scene scene = *testing::nonholonomic();
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2]) -
           0.15 * q[0] * q[0] * q[2] * q[2];
  });
  scene.start.q << 1.4029222554620677, 0.0, 0.14142135623730953;
  scene.start.v << 0.0, 1.0, 0.0;
  return std::make_shared<const Scene>(scene);
}

/// Mean energy over the last steps of a run beside that over the first ones.
double energy_drift(bool compensated, long steps) {
  Integrator integrator =
      make(contact_oscillator(), {.method = "type1/gl:4", .step = 0.05, .compensated_sums = compensated});
  const long window = steps / 10;
  double first = 0.0, last = 0.0;
  Sample sample;
  for (long k = 0; k < steps; ++k) {
    EXPECT_TRUE(integrator.step().ok());
    if (k >= window && k < steps - window) continue;
    EXPECT_TRUE(integrator.sample(Momentum::projected, sample).ok());
    (k < window ? first : last) += sample.energy / static_cast<double>(window);
  }
  return std::abs(last - first);
}

TEST(CompensatedSums, EnergyDriftsLessThanWithPlainSums_slow) {
  const double plain = energy_drift(false, 1'000'000), compensated = energy_drift(true, 1'000'000);
  EXPECT_LT(compensated, 1e-14);
  EXPECT_GT(plain, 5.0 * compensated);
}

TEST(CompensatedSums, AreRefusedWhereTheStepHasNone) {
  expect_misuse(
      [] {
        make(testing::unconstrained(),
             {.method = "type1/trapezoidal", .step = 0.1, .compensated_sums = true});
      },
      {"type1/trapezoidal", "compensated"});
}

}  // namespace
}  // namespace diracstep
