#include <gtest/gtest.h>

#include <diracstep/validation/references/ida_reference.hpp>

#include "kernel_cases.hpp"

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

TEST(KernelReference, OtherFormulationsAreNotOffered) {
  EXPECT_EQ(formulations_of(*testing::moving_kernel_with_row().scene).size(), 1u);
  EXPECT_EQ(formulations_of(*testing::inner_coordinate_on_circle().scene).size(), 1u);
}

}  // namespace
}  // namespace diracstep
