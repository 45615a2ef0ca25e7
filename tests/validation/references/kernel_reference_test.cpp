#include <gtest/gtest.h>

#include <diracstep/validation/references/explicit_reference.hpp>
#include <diracstep/validation/references/ida_reference.hpp>

#include "levelled_cases.hpp"

namespace diracstep {
namespace {

/// IDA comes as near to the reductions by hand as its tolerance says, on every class with hidden equations.
TEST(KernelReference, IdaConvergesToTheReductionsByHand) {
  for (const testing::DegenerateCase& that : testing::kernel_cases()) {
    double before = 1.0;
    for (const double rtol : {1e-6, 1e-9}) {
      ReferenceOptions options;
      options.rtol = rtol;
      const ReferenceRun run = integrate_with_ida(*that.scene, 1.0, options);
      ASSERT_TRUE(run.ok()) << that.scene->name << ": " << run.failure;
      const double error = (run.end.q - that.q).lpNorm<Eigen::Infinity>();
      EXPECT_LT(error, 200.0 * rtol) << that.scene->name;
      EXPECT_LT(error, 0.1 * before) << that.scene->name << ": a smaller tolerance is no better";
      before = error;
    }
  }
}

/// The same where the constraint algorithm has levels, and velocities at the start are not given.
TEST(KernelReference, IdaComesToTheReductionsByHandOfConstraintsOfLevels) {
  for (const testing::DegenerateCase& that : testing::levelled_cases()) {
    ReferenceOptions options;
    options.rtol = 1e-7;
    const ReferenceRun run = integrate_with_ida(*that.scene, 1.0, options);
    ASSERT_TRUE(run.ok()) << that.scene->name << ": " << run.failure;
    EXPECT_LT((run.end.q - that.q).lpNorm<Eigen::Infinity>(), 2e-5) << that.scene->name;
  }
}

TEST(References, ShowMultipliersThatAreCoordinates) {
  Scene scene = testing::scene_of("tension", {"x", "y", "a"});
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) - q[1] - q[2] * (q[0] * q[0] + q[1] * q[1] - 1.0);
  });
  scene.start = {0.0, Vector{{1.0, 0.0, 0.0}}, Vector{{0.0, 0.6, 0.0}}};
  ReferenceOptions options;
  options.rtol = 1e-9;
  for (const ReferenceRun& run :
       {integrate_with_ida(scene, 1.0, options), integrate_explicitly(scene, 1.0, options)}) {
    ASSERT_TRUE(run.ok()) << run.failure;
    EXPECT_NEAR(run.end.q[2], 0.5 * (run.end.v.head(2).squaredNorm() - run.end.q[1]), 1e-7);
    EXPECT_GT(std::abs(run.end.q[2]), 0.01);
  }
}

TEST(References, WithoutAccelerationsThereIsNoExplicitOne) {
  ReferenceOptions options;
  for (const auto& scene : {testing::moving_kernel().scene, testing::canonical_pendulum().scene})
    EXPECT_NE(integrate_explicitly(*scene, 1.0, options).failure.find("not explicit: "), std::string::npos)
        << scene->name;
}

TEST(KernelReference, OtherFormulationsAreNotOffered) {
  EXPECT_EQ(formulations_of(*testing::moving_kernel_with_row().scene).size(), 1u);
  EXPECT_EQ(formulations_of(*testing::inner_coordinate_on_circle().scene).size(), 1u);
}

}  // namespace
}  // namespace diracstep
