#include <gtest/gtest.h>

#include <diracstep/core/runs/ensemble.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <stdexcept>

#include "misuse.hpp"
#include "scenes.hpp"

namespace diracstep {
namespace {

/// Starts at different times of one trajectory, so that all are consistent.
std::vector<Start> starts_of(const std::shared_ptr<const Scene>& scene, int count) {
  Integrator integrator(scene, Registry::with_built_ins(), kinsol(), {.step = 0.05});
  std::vector<Start> starts;
  Sample sample;
  for (int k = 0; k < count; ++k) {
    EXPECT_TRUE(integrator.sample(Momentum::projected, sample).ok());
    starts.push_back({sample.time, sample.q, sample.v});
    EXPECT_TRUE(integrator.step().ok());
  }
  return starts;
}

TEST(Ensemble, IsTheSameBitsOnAnyNumberOfThreads) {
  for (const auto& scene : testing::every_constraint_class())
    for (const char* method : {"type1/midpoint", "type1/gl:3"}) {
      const auto starts = starts_of(scene, 9);
      const IntegratorOptions options{.method = method, .step = 0.05};
      const auto ends = [&](int threads) {
        return run_ensemble(scene, Registry::with_built_ins(), kinsol(), options, starts, 40,
                            Momentum::projected, threads);
      };
      const auto serial = ends(1);
      ASSERT_EQ(serial.size(), starts.size());
      for (const int threads : {0, 2, 4, 20}) {
        const auto parallel = ends(threads);
        for (std::size_t k = 0; k < starts.size(); ++k) {
          EXPECT_TRUE(parallel[k].last.ok());
          EXPECT_EQ(parallel[k].end.q, serial[k].end.q) << scene->name << " " << k;
          EXPECT_EQ(parallel[k].end.p, serial[k].end.p) << scene->name << " " << k;
        }
      }
      // Each member is what an integrator of its own makes of its start.
      Integrator alone(scene, Registry::with_built_ins(), kinsol(), options);
      alone.reset(starts[5]);
      for (int k = 0; k < 40; ++k) ASSERT_TRUE(alone.step().ok());
      EXPECT_EQ(alone.position(), serial[5].end.q) << scene->name;
    }
}

TEST(Ensemble, StartsMayHaveAMomentumInPlaceOfAVelocity) {
  for (const auto& scene : testing::every_constraint_class()) {
    std::vector<Start> with_velocity = starts_of(scene, 3), with_momentum = with_velocity;
    for (Start& start : with_momentum) {
      Vector lq(3);
      start.p.setZero(3);
      scene->lagrangian->gradient(start.time, start.q, start.v, lq, start.p);
      start.v.resize(0);
    }
    const auto ends = [&](const std::vector<Start>& starts) {
      return run_ensemble(scene, Registry::with_built_ins(), kinsol(), {.step = 0.05}, starts, 5);
    };
    const auto expected = ends(with_velocity), found = ends(with_momentum);
    for (std::size_t k = 0; k < expected.size(); ++k) {
      ASSERT_TRUE(found[k].last.ok()) << found[k].last.failure;
      EXPECT_LT((found[k].end.q - expected[k].end.q).norm(), 1e-12) << scene->name;
      EXPECT_LT((found[k].end.p - expected[k].end.p).norm(), 1e-12) << scene->name;
    }
  }
}

TEST(Ensemble, WithoutStartsIsEmpty) {
  EXPECT_TRUE(
      run_ensemble(testing::mixed(), Registry::with_built_ins(), kinsol(), {.step = 0.1}, {}, 3).empty());
}

TEST(Ensemble, MisuseAndExceptionsPassThrough) {
  auto starts = starts_of(testing::nonholonomic(), 6);
  const auto run = [&](int threads) {
    (void)run_ensemble(testing::nonholonomic(), Registry::with_built_ins(), kinsol(), {.step = 0.1}, starts,
                       3, Momentum::projected, threads);
  };
  testing::expect_misuse([&] { run(-1); }, {"threads = -1"});
  starts[4].v[0] += 1.0;
  testing::expect_misuse([&] { run(3); }, {"'contact'"});
}

}  // namespace
}  // namespace diracstep
