#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/kernel_motions.hpp>

#include "kernel_cases.hpp"
#include "methods.hpp"
#include "misuse.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::DegenerateCase;
using testing::distance;
using testing::expect_misuse;
using testing::gl;
using testing::inner_coordinate;
using testing::kernel_cases;
using testing::moving_kernel;
using testing::samples_of;

TEST(KernelStep, OrderIsTwiceTheStages) {
  for (const DegenerateCase& that : kernel_cases())
    for (const auto& [s, steps] : {std::pair{1, 40L}, {2, 10L}, {3, 4L}})
      testing::expect_order_of_stages(that, s, steps, 3e-13);
}

TEST(KernelStep, JacobianAgreesWithDifferences) {
  for (const DegenerateCase& that : kernel_cases())
    for (const int s : {1, 2}) testing::expect_exact_jacobian(that, s);
}

TEST(KernelStep, KeepsRowsHiddenEquationsAndPrimaryConstraints) {
  for (const DegenerateCase& that : kernel_cases()) {
    const auto samples = samples_of(that.scene, {.method = gl(2), .step = 0.05}, 60);
    const FirstOrderMotions motions = first_order_motions(*that.scene);
    ASSERT_TRUE(motions.hide_equations()) << that.scene->name;
    KernelPoint point(*that.scene, motions);
    for (const Sample& at : samples) {
      point.evaluate(at.time, at.q, at.v, at.lambda);
      EXPECT_LT(distance(point.full().momentum(), at.p), 1e-12) << that.scene->name;
      EXPECT_LT(point.along().lpNorm<Eigen::Infinity>(), 1e-11) << that.scene->name << " t = " << at.time;
      testing::expect_on_holonomic_rows(*that.scene, at);
    }
  }
}

TEST(KernelStep, IsSelfAdjoint) {
  for (const DegenerateCase& that : kernel_cases())
    for (const int s : {1, 2, 3}) testing::expect_self_adjoint(that, s, 2e-13);
}

TEST(KernelStep, StartsOffTheHiddenEquationAreToldAndMoved) {
  Scene off = *inner_coordinate().scene;
  const double s = off.start.q[1];
  off.start.q[1] = 0.3;
  const auto take = [&](bool project) {
    return Integrator(std::make_shared<const Scene>(off), Registry::with_built_ins(), kinsol(),
                      {.method = gl(2), .step = 0.1, .project_start = project});
  };
  expect_misuse([&] { (void)take(false); }, {"'inner coordinate'", "along 's'", "holds no acceleration"});
  EXPECT_NO_THROW((void)take(true));
  Guesses guesses{{false, true}, {false, false}};
  const ProjectedStart moved = project_start(off, off.start, kinsol(), guesses);
  EXPECT_NEAR(moved.start.q[1], s, 1e-14);
  EXPECT_EQ(moved.start.q[0], off.start.q[0]);
}

TEST(KernelStep, WhatIsSingularIsRefusedWithItsDirection) {
  Scene scene = testing::scene_of("singular", {"x", "s"});  // v_x = 0 for ever, and nothing tells s
  scene.lagrangian = lagrangian<2>(
      [](const auto& q, const auto& v) { return 0.5 * (1.0 + q[1]) * v[0] * v[0] - 0.5 * q[0] * q[0]; });
  scene.start = {0.0, Vector{{0.0, 0.2}}, Vector{{0.0, 0.0}}};
  const auto take = [&](const std::string& method) {
    (void)Integrator(std::make_shared<const Scene>(scene), Registry::with_built_ins(), kinsol(),
                     {.method = method, .step = 0.1});
  };
  expect_misuse([&] { take(gl(2)); }, {"'singular'", "the velocity along 's'"});
  scene = *moving_kernel().scene;
  expect_misuse([&] { take("type1/trapezoidal"); }, {"'moving kernel'", "degenerate", "type1/midpoint"});
  expect_misuse([&] { take("damped/radau:2"); }, {"'moving kernel'", "Radau IIA"});
}

}  // namespace
}  // namespace diracstep
