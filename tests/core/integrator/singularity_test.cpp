#include <gtest/gtest.h>

#include <diracstep/core/integrator/singularity.hpp>
#include <diracstep/core/system/hidden_rows.hpp>

#include "misuse.hpp"
#include "scenes.hpp"
#include "stepping.hpp"

/// A singular step is told apart from slow convergence, and what is degenerate is named.
namespace diracstep {
namespace {

using testing::expect_misuse;
using testing::expect_parts;

StepReport first_failure(const Scene& scene, const IntegratorOptions& options, long steps) {
  Integrator integrator(std::make_shared<const Scene>(scene), Registry::with_built_ins(), kinsol(), options);
  for (long k = 0; k < steps; ++k) {
    StepReport report = integrator.step();
    if (!report.ok()) return report;
  }
  return {};
}

/// On x y = 0, one step before the crossing of its two branches, where the row vanishes; a force presses on
/// it.
Scene towards_the_crossing() {
  Scene scene;
  scene.name = "crossing";
  scene.coordinates = {"x", "y"};
  scene.lagrangian = lagrangian<2>(
      [](const auto& q, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]) - 0.3 * q[1]; });
  scene.constraints = {holonomic<2, 1>(
      []<class T>(const std::array<T, 2>& q) { return std::array<T, 1>{q[0] * q[1]}; }, {"branches"})};
  scene.start = {0.0, Vector{{-0.125, 0.0}}, Vector{{1.0, 0.0}}};
  return scene;
}

TEST(Singularity, ABifurcationIsToldWithTheRowsThatMeetThere) {
  const StepReport report =
      first_failure(towards_the_crossing(), {.method = "type1/midpoint", .step = 0.125}, 1);
  ASSERT_FALSE(report.ok());
  EXPECT_EQ(report.solve.status, SolveStatus::singular_jacobian);
  expect_parts(report.failure, {"singular", "row 'branches'"});
}

TEST(Singularity, ADegenerateDiscreteLagrangianNamesItsCoordinate) {
  // L = v²/2 + q²/2 has D1D2 L_d = −1/h + h/4 = 0 at h = 2; the second coordinate is a free particle.
  Scene scene;
  scene.name = "saddle";
  scene.coordinates = {"unstable", "free"};
  scene.lagrangian = lagrangian<2>(
      [](const auto& q, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]) + 0.5 * q[0] * q[0]; });
  scene.start = {0.0, Vector{{1.0, 0.0}}, Vector{{0.5, 1.0}}};
  const StepReport report = first_failure(scene, {.method = "type1/midpoint", .step = 2.0}, 1);
  ASSERT_FALSE(report.ok());
  expect_parts(report.failure, {"singular there, rank 1 of 2", "momentum of 'unstable'"});
  EXPECT_EQ(report.failure.find("'free'"), std::string::npos) << report.failure;
}

TEST(Singularity, SlowConvergenceIsToldAsThat) {
  KinsolOptions few;
  few.max_iterations = 1;
  const auto scene = testing::mixed();
  Integrator integrator(scene, Registry::with_built_ins(), kinsol(few),
                        {.method = "type1/midpoint", .step = 0.5});
  const StepReport report = integrator.step();
  ASSERT_FALSE(report.ok());
  expect_parts(report.failure, {"no convergence", "regular there", "smaller step"});
  EXPECT_EQ(report.failure.find("singular"), std::string::npos) << report.failure;
}

TEST(Singularity, ANullPointerAmongTheRowsIsRefused) {
  Scene scene = testing::particle("holey");
  scene.constraints = {nullptr};
  expect_misuse([&] { (void)first_failure(scene, {.step = 0.1}, 1); }, {"'holey'", "null"});
}

TEST(HiddenRows, RegularScenesHaveNone) {
  for (const auto& scene : testing::every_constraint_class())
    EXPECT_EQ(with_hidden_rows(scene), scene) << scene->name;
  // A mass that vanishes at the start alone hides nothing either.
  Scene quartic = testing::particle("quartic");
  quartic.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return v[0] * v[0] * v[0] * v[0] + 0.5 * (v[1] * v[1] + v[2] * v[2]) - 0.5 * q[0] * q[0];
  });
  quartic.start.v[0] = 0.0;
  EXPECT_TRUE(hidden_rows(quartic).empty());
}

TEST(HiddenRows, AreTheVoltageLawAndItsDerivatives) {
  const auto scene = laws::degenerate_circuit();
  const ConstraintBlocks blocks = hidden_rows(*scene);
  ASSERT_EQ(row_count(blocks), 1);
  ASSERT_TRUE(blocks[0]->holonomic());
  EXPECT_NE(blocks[0]->names()[0].find("q1"), std::string::npos) << blocks[0]->names()[0];
  const double t = 0.4, delta = 1e-5;
  const Vector q{{0.1, 0.7, -0.2}};
  const auto phi = [&](double time, const Vector& at) {
    Vector value(1);
    blocks[0]->position(time, at, value);
    return value[0];
  };
  // q1 + 0.4 q1³ = q2 + 0.2 q2² − 0.3 sin t around the loop, in units in which its largest coefficient is 1
  const double law = 0.7 + 0.4 * 0.343 + 0.2 - 0.2 * 0.04 + 0.3 * std::sin(t), unit = 1.0 + 1.2 * 0.25;
  EXPECT_NEAR(std::abs(phi(t, q)), law / unit, 1e-14);
  Vector a(blocks[0]->pattern().nonzeros()), b(1);
  blocks[0]->coefficients(t, q, a, b);
  const Columns full = blocks[0]->pattern().full(a);
  for (int i = 0; i < 3; ++i) {
    const Vector step = delta * Vector::Unit(3, i);
    EXPECT_NEAR(full(0, i), (phi(t, q + step) - phi(t, q - step)) / (2.0 * delta), 1e-9) << i;
  }
  EXPECT_NEAR(b[0], (phi(t + delta, q) - phi(t - delta, q)) / (2.0 * delta), 1e-9);
}

TEST(HiddenRows, VelocitiesWithoutMomentumAreSetByThem) {
  const auto scene = with_hidden_rows(laws::degenerate_circuit());
  EXPECT_NO_THROW(require_consistent(*scene, scene->start));
  EXPECT_EQ(scene->start.v[0], 0.3);
  EXPECT_NEAR(scene->start.v[1] + scene->start.v[2], 0.3, 1e-15);
  EXPECT_GT(std::abs(scene->start.v[2]), 0.01) << "the given velocities were kept";
}

TEST(HiddenRows, WhatIsNotDescribedIsRefusedWithTheReason) {
  Scene scene = testing::particle("massless");
  const auto refused = [&](std::initializer_list<std::string> parts) {
    expect_misuse([&] { (void)hidden_rows(scene); }, parts);
  };
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) * (1.0 + q[2]) - 0.5 * q[2] * q[2];
  });
  EXPECT_TRUE(hidden_rows(scene).empty()) << "what holds velocities is no row (kernel_motions.hpp)";
  scene.lagrangian = lagrangian<3>(
      [](const auto& q, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]) - 0.5 * q[0] * q[0]; });
  refused({"'z'", "neither a potential nor a force"});
  scene.force = force<3>([]<class T>(const std::array<T, 3>&, const std::array<T, 3>& v) {
    return std::array<T, 3>{T(0.0), T(0.0), -v[2] * v[2] - v[2]};
  });
  EXPECT_TRUE(hidden_rows(scene).empty())
      << "its velocity follows from the force (FirstOrderMotions::by_force)";
}

TEST(Sample, TheImpulseIsWhatTheMinusMomentumHasMore) {
  const auto scene = testing::mixed();
  Integrator integrator(scene, Registry::with_built_ins(), kinsol(),
                        {.method = "type1/midpoint", .step = 0.05});
  for (int k = 0; k < 5; ++k) ASSERT_TRUE(integrator.step().ok());
  Sample plus, minus;
  ASSERT_TRUE(integrator.sample(Momentum::plus, plus).ok());
  ASSERT_TRUE(integrator.sample(Momentum::minus, minus).ok());
  EXPECT_EQ(plus.impulse.size(), 0);
  ASSERT_EQ(minus.impulse.size(), scene->rows());
  ConstraintsAtPoint rows(scene->constraints, 3);
  rows.evaluate(minus.time, minus.q);
  Vector p = plus.p;
  rows.add_annihilator(minus.impulse, p);
  EXPECT_LT((p - minus.p).lpNorm<Eigen::Infinity>(), 1e-15);
  EXPECT_GT(minus.impulse.norm(), 1e-3);
}

}  // namespace
}  // namespace diracstep
