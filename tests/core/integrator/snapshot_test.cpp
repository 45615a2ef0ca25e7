#include <gtest/gtest.h>

#include <diracstep/core/numerics/snapshot.hpp>

#include "combinations.hpp"
#include "misuse.hpp"

namespace diracstep {
namespace {

using testing::expect_misuse;
using testing::for_every_combination;
using testing::integrator_for;
using testing::same_bits;
using testing::ScenePointer;

std::vector<Sample> steps_of(Integrator& integrator, int count, Momentum momentum) {
  std::vector<Sample> samples(static_cast<std::size_t>(count));
  for (Sample& sample : samples) {
    EXPECT_TRUE(integrator.step().ok());
    EXPECT_TRUE(integrator.sample(momentum, sample).ok());
  }
  return samples;
}

TEST(RestoredIntegrator, GoesOnWithTheSameBits) {
  for_every_combination([](const ScenePointer& scene, const IntegratorOptions& options) {
    for (const Momentum momentum : {Momentum::projected, Momentum::minus})
      for (const int before : {0, 1, 3, 14}) {
        Integrator whole = integrator_for(scene, options), second = integrator_for(scene, options);
        (void)steps_of(whole, before, momentum);
        const Snapshot snapshot = whole.save();
        (void)steps_of(second, 2, Momentum::plus);  // what it did before must not matter
        second.restore(snapshot);
        EXPECT_EQ(second.time(), whole.time());
        EXPECT_TRUE(same_bits(steps_of(second, 20, momentum), steps_of(whole, 20, momentum))) << before;
        EXPECT_EQ(second.work().steps, whole.work().steps);
        EXPECT_EQ(second.work().solves, whole.work().solves);
        EXPECT_EQ(second.work().iterations, whole.work().iterations);
      }
  });
}

TEST(RestoredIntegrator, PivotsOfAnEarlierMatrixAreKept) {
  // The mass of x grows by 1e12 within a step of the start, so that pivots chosen now differ from those then.
  Scene scene = testing::particle("growing mass");
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v, const auto& t) {
    using std::exp;
    return 0.5 * (exp(0.3 * t) * v[0] * v[0] + v[1] * v[1] + exp(-0.3 * t) * v[2] * v[2]) +
           v[0] * v[1] * 0.2 + v[1] * v[2] * 0.3 - q[0] * q[0] - q[1] * q[2];
  });
  const auto shared = std::make_shared<const Scene>(scene);
  const IntegratorOptions options{.method = "type1/trapezoidal", .step = 0.05, .dense_limit = 0};
  Integrator whole = integrator_for(shared, options), second = integrator_for(shared, options);
  (void)steps_of(whole, 200, Momentum::plus);
  second.restore(whole.save());
  EXPECT_TRUE(same_bits(steps_of(second, 50, Momentum::plus), steps_of(whole, 50, Momentum::plus)));
}

TEST(RestoredIntegrator, OldFactorsAndWhatRoundingDroppedAreKept) {
  for (const auto& scene : testing::every_constraint_class())
    for (const char* method : {"type1/midpoint", "type1/gl:3"})
      for (const bool compensated : {false, true})
        for (const JacobianPolicy policy : {JacobianPolicy::kept, JacobianPolicy::per_step})
          for (const Iteration iteration : {Iteration::newton, Iteration::automatic})
            for (const int limit : {40, 0}) {
              const IntegratorOptions options{
                  .method = method, .step = 0.05, .dense_limit = limit, .compensated_sums = compensated};
              SCOPED_TRACE(testing::describe(scene, options));
              const auto make = [&] {
                return Integrator(scene, Registry::with_built_ins(),
                                  kinsol({.jacobian = policy, .iteration = iteration}), options);
              };
              if (compensated && std::string(method) == "type1/midpoint") continue;  // not in every class
              for (const int before : {1, 9, 14}) {
                Integrator whole = make(), second = make();
                (void)steps_of(whole, before, Momentum::minus);
                second.restore(whole.save());
                EXPECT_TRUE(
                    same_bits(steps_of(second, 20, Momentum::plus), steps_of(whole, 20, Momentum::plus)))
                    << before;
                EXPECT_EQ(second.work().iterations, whole.work().iterations);
                EXPECT_EQ(second.work().jacobian_evaluations, whole.work().jacobian_evaluations);
              }
            }
}

TEST(RestoredIntegrator, ConstantJacobiansOfEachStepSizeAreKept) {
  // A chain of springs: the Jacobian of GL depends on the step size alone, and a composition has several.
  Scene scene = testing::particle("springs");
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) - 0.5 * q[0] * q[0] -
           0.5 * (q[1] - q[0]) * (q[1] - q[0]) - (q[2] - q[1]) * (q[2] - q[1]);
  });
  const auto shared = std::make_shared<const Scene>(scene);
  for (const int limit : {40, 0}) {
    const IntegratorOptions options{.method = "type1/gl:2", .order = 8, .step = 0.1, .dense_limit = limit};
    Integrator whole = integrator_for(shared, options), second = integrator_for(shared, options);
    (void)steps_of(whole, 7, Momentum::plus);
    second.restore(whole.save());
    EXPECT_TRUE(same_bits(steps_of(second, 20, Momentum::plus), steps_of(whole, 20, Momentum::plus)));
    EXPECT_EQ(second.work().jacobian_evaluations, whole.work().jacobian_evaluations);
  }
}

TEST(RestoredIntegrator, CoversStepsOfVariableSize) {
  const auto scene = testing::mixed();
  const IntegratorOptions options{.method = "type1/gl:2", .step = 0.05};
  Integrator whole = integrator_for(scene, options), second = integrator_for(scene, options);
  for (const double h : {0.03, 0.1, 0.07, 0.07}) ASSERT_TRUE(whole.step(h).ok());
  second.restore(whole.save());
  expect_misuse([&] { (void)second.retry(0.05); }, {"retry", "no step"});
  for (const double h : {0.07, 0.05, 0.01}) {
    ASSERT_TRUE(whole.step(h).ok());
    ASSERT_TRUE(second.step(h).ok());
    EXPECT_EQ(second.time(), whole.time());
    EXPECT_EQ(second.position(), whole.position());
    EXPECT_EQ(second.momentum(), whole.momentum());
  }
}

TEST(RestoredIntegrator, RefusesASnapshotThatDoesNotFitByNameAndStandsAtItsStart) {
  const auto scene = testing::mixed();
  Integrator one = integrator_for(scene, {.method = "type1/gl:2", .step = 0.05});
  (void)steps_of(one, 5, Momentum::plus);
  const Snapshot snapshot = one.save();
  const auto refused = [&](const IntegratorOptions& options, const Snapshot& bad,
                           std::initializer_list<std::string> parts) {
    Integrator integrator = integrator_for(scene, options);
    (void)steps_of(integrator, 3, Momentum::plus);
    expect_misuse([&] { integrator.restore(bad); }, parts);
    EXPECT_EQ(integrator.position(), scene->start.q);
    EXPECT_EQ(integrator.work().steps, 0);
    EXPECT_TRUE(integrator.step().ok());
  };
  const IntegratorOptions same{.method = "type1/gl:2", .step = 0.05};
  refused({.method = "type1/gl:3", .step = 0.05}, snapshot,
          {"'integrator of type1/gl:2, order 4'", "'integrator of type1/gl:3, order 6'",
           "another scene, method"});
  refused({.method = "type1/gl:2", .order = 6, .step = 0.05}, snapshot, {"order 4", "order 6"});
  refused({.method = "type1/gl:2", .step = 0.025}, snapshot, {"steps of 0.05", "takes 0.025"});
  IntegratorOptions compensated = same;
  compensated.compensated_sums = true;
  refused(compensated, snapshot, {"0 numbers for 'position rest'"});
  refused(same, Snapshot(), {"ends before 'integrator of type1/gl:2"});
  Snapshot longer = snapshot;
  longer.put("one more", 0.0);
  refused(same, longer, {"goes on with 'one more'"});
  for (const double value : {-1.0, 0.5, 1e300, std::nan("")}) {
    Snapshot changed = snapshot;
    changed.numbers()[1] = value;
    refused(same, changed, {"for 'steps'", "a whole number from 0"});
  }
}

}  // namespace
}  // namespace diracstep
