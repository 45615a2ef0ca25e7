#include <gtest/gtest.h>

#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/validation/laws/law_scenes.hpp>
#include <diracstep/validation/laws/stage_membership.hpp>

namespace diracstep {
namespace {

std::vector<std::shared_ptr<const Scene>> scenes_with_rows() {
  return {laws::nonholonomic(), laws::holonomic_sphere(), laws::mixed(), laws::driven()};
}

TEST(StageMembership, HoldsForEveryTypeStageNumberAndKindOfRows) {
  const Registry registry = Registry::with_built_ins();
  for (const auto& scene : scenes_with_rows())
    for (const char* type : {"type1", "type2", "type3"})
      for (const char* stages : {"1", "2", "3", "5"}) {
        const std::string method = std::string(type) + "/gl:" + stages;
        EXPECT_LT(stage_membership_residual(registry, scene, {.method = method, .step = 0.05}, 20), 2e-13)
            << scene->name << " " << method;
      }
}

TEST(StageMembership, IsStatedForGaussLobattoStepsWithoutForces) {
  const Registry registry = Registry::with_built_ins();
  const IntegratorOptions midpoint{.method = "type1/midpoint", .step = 0.05};
  EXPECT_THROW((void)stage_membership_residual(registry, laws::mixed(), midpoint, 1), Misuse);
  const IntegratorOptions gauss{.method = "type1/gl:2", .step = 0.05};
  EXPECT_THROW((void)stage_membership_residual(registry, laws::forced(laws::mixed()), gauss, 1), Misuse);
}

}  // namespace
}  // namespace diracstep
