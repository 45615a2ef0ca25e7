#include <gtest/gtest.h>

#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/contradictory_rows.hpp>
#include <diracstep/core/system/redundant_rows.hpp>

#include "misuse.hpp"
#include "scenes.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

/// The mixed scene with a start off the sphere and off the distribution.
std::shared_ptr<Scene> inconsistent() {
  auto scene = std::make_shared<Scene>(*testing::mixed());
  scene->start.q[0] += 0.1;
  scene->start.v[1] += 0.2;
  return scene;
}

TEST(ProjectedStart, ProjectionLandsOnTheNearestPointAndVelocity) {
  const auto scene = inconsistent();
  const ProjectedStart projected = project_start(*scene, scene->start, kinsol());
  EXPECT_NO_THROW(require_consistent(*scene, projected.start));
  EXPECT_GT(projected.position_moved, 0.01);
  EXPECT_LT(projected.position_moved, 0.1);  // the nearest point is nearer than the one it came from
  EXPECT_GT(projected.velocity_moved, 0.01);
  // The way to the nearest point is along the gradient of the sphere.
  const Vector way = scene->start.q - projected.start.q;
  Vector gradient(3);
  gradient << 2.0 * projected.start.q[0], 2.0 * projected.start.q[1], projected.start.q[2];
  EXPECT_NEAR(std::abs(way.dot(gradient)), way.norm() * gradient.norm(), 1e-12);
}

TEST(ProjectedStart, AConsistentStartStays) {
  for (const auto& scene : testing::every_constraint_class()) {
    const ProjectedStart projected = project_start(*scene, scene->start, kinsol());
    EXPECT_LT(projected.position_moved + projected.velocity_moved, 1e-14) << scene->name;
  }
}

TEST(ProjectedStart, APositionThatMayNotMoveIsToldAsOneWhateverTheSceneIsCalled) {
  const auto scene = inconsistent();
  scene->name = "A v + b";
  const Guesses none_of_q{std::vector<bool>(static_cast<std::size_t>(scene->dimension()), false), {}};
  testing::expect_misuse([&] { (void)project_start(*scene, scene->start, kinsol(), none_of_q); },
                         {"φ(q) = ", "no position is named as a guess"});
}

TEST(ProjectedStart, TheIntegratorRefusesOrProjectsAsAsked) {
  EXPECT_THROW(Integrator(inconsistent(), Registry::with_built_ins(), kinsol(), {.step = 0.1}), Misuse);
  Integrator integrator(inconsistent(), Registry::with_built_ins(), kinsol(),
                        {.step = 0.1, .project_start = true});
  EXPECT_TRUE(integrator.step().ok());
  EXPECT_EQ(integrator.plan().front().item, "start");
}

TEST(ProjectedStart, AMomentumOffTheDistributionIsProjectedAndTheDistanceTold) {
  // With unit masses the velocity is p; the nearest one on v_x + y v_z = 0 is its Euclidean projection.
  Scene scene = *testing::nonholonomic();
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) - 0.5 * q[0] * q[0];
  });
  const double y = scene.start.q[1];
  const Vector p{{1.0, 2.0, 3.0}}, row{{1.0, 0.0, y}};
  const Start start{0.0, scene.start.q, Vector(), p};
  const ProjectedStart projected = project_start(scene, start, kinsol());
  const double off = row.dot(p) / row.squaredNorm();
  EXPECT_LT((projected.start.v - (p - off * row)).norm(), 1e-14);
  EXPECT_NEAR(projected.velocity_moved, std::abs(off) * row.norm(), 1e-14);
  EXPECT_EQ(projected.position_moved, 0.0);
}

TEST(ProjectedStart, HiddenRowsCountAsRows) {
  const auto scene = laws::degenerate_circuit();
  Start start = scene->start;
  start.q[2] += 0.2;
  const ProjectedStart projected = project_start(*scene, start, kinsol());
  const Vector& q = projected.start.q;
  EXPECT_NEAR(q[1] + 0.4 * std::pow(q[1], 3), q[2] + 0.2 * q[2] * q[2], 1e-13);
  EXPECT_GT(projected.position_moved, 0.1);
  EXPECT_LT(projected.position_moved, 0.2);
}

TEST(ProjectedStart, UnreachableConstraintsAreRefusedWithTheReason) {
  Scene scene = testing::particle("impossible");
  scene.constraints = {holonomic<3, 1>(
      []<class T>(const std::array<T, 3>& q) { return std::array<T, 1>{q[0] * q[0] + 1.0 + 0.0 * q[1]}; })};
  try {
    (void)project_start(scene, scene.start, kinsol());
    FAIL() << "an impossible constraint was satisfied";
  } catch (const Misuse& misuse) {
    EXPECT_NE(std::string(misuse.what()).find("cannot be projected"), std::string::npos) << misuse.what();
  }
}

/// The contact row twice, the second time in other units and with something that vanishes at the start added.
std::shared_ptr<const Scene> redundant() {
  auto scene = std::make_shared<Scene>(*testing::nonholonomic());
  scene->constraints.push_back(pfaffian<3, 2>(
      []<class T>(const std::array<T, 3>& q) {
        return std::array<std::array<T, 3>, 2>{{{T(0.0), T(1.0), T(0.0)}, {T(1e6), T(0.0), 1e6 * q[1]}}};
      },
      {"wall", "contact again"}));
  scene->start.v[1] = 0.0;
  return scene;
}

TEST(RedundantRows, AreNamedWhateverTheirUnits) {
  const auto scene = redundant();
  const auto names = redundant_rows(*scene, scene->start);
  ASSERT_EQ(names.size(), 1U);
  EXPECT_TRUE(names[0] == "contact again" || names[0] == "contact") << names[0];
  for (const auto& independent : testing::every_constraint_class())
    EXPECT_TRUE(redundant_rows(*independent, independent->start).empty()) << independent->name;
}

TEST(RedundantRows, AreLeftOutUnlessTheSceneRefusesThem) {
  auto refusing = std::make_shared<Scene>(*redundant());
  refusing->refuse_redundant_rows = true;
  try {
    const Integrator taken(refusing, Registry::with_built_ins(), kinsol(), {.step = 0.1});
    FAIL() << "dependent rows were taken";
  } catch (const Misuse& misuse) {
    EXPECT_NE(std::string(misuse.what()).find("contact"), std::string::npos) << misuse.what();
    EXPECT_NE(std::string(misuse.what()).find(redundant()->name), std::string::npos) << misuse.what();
  }
  auto clean = std::make_shared<Scene>(*redundant());
  clean->constraints = {pfaffian<3, 2>([]<class T>(const std::array<T, 3>& q) {
    return std::array<std::array<T, 3>, 2>{{{T(1.0), T(0.0), q[1]}, {T(0.0), T(1.0), T(0.0)}}};
  })};
  const auto expected = testing::samples_of(clean, {.step = 0.1}, 10).back();
  const auto left_out = testing::samples_of(redundant(), {.step = 0.1}, 10).back();
  const auto asked = testing::samples_of(refusing, {.step = 0.1, .drop_redundant_rows = true}, 10).back();
  EXPECT_LT((left_out.q - expected.q).norm(), 1e-13);
  EXPECT_EQ(asked.q, left_out.q);
}

/// Of a force Λ of a row r that is also given as 2 r and 3 r: the least that act as it does are Λ/14, 2 Λ/14
/// and 3 Λ/14.
TEST(RedundantRows, HaveTheLeastForcesOfAll) {
  constexpr auto rod = []<class T>(const std::array<T, 2>& x) { return x[0] * x[0] + x[1] * x[1] - 1.0; };
  auto once = std::make_shared<Scene>();
  once->name = "pendulum";
  once->coordinates = {"x", "y"};
  once->lagrangian = lagrangian<2>(
      [](const auto& x, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]) - 9.81 * x[1]; });
  once->constraints = {
      holonomic<2, 1>([=]<class T>(const std::array<T, 2>& x) { return std::array<T, 1>{rod(x)}; }, {"rod"})};
  once->start = {0.0, Vector{{1.0, 0.0}}, Vector::Zero(2)};
  auto thrice = std::make_shared<Scene>(*once);
  thrice->constraints.push_back(holonomic<2, 2>(
      [=]<class T>(const std::array<T, 2>& x) {
        return std::array<T, 2>{2.0 * rod(x), 3.0 * rod(x)};
      },
      {"twice", "thrice"}));
  const double force = testing::samples_of(once, {.step = 0.05}, 10).back().lambda[0];
  Integrator integrator(thrice, Registry::with_built_ins(), kinsol(), {.step = 0.05});
  ASSERT_EQ(integrator.scene().rows(), 1);
  for (int k = 0; k < 10; ++k) ASSERT_TRUE(integrator.step().ok());
  Sample end;
  ASSERT_TRUE(integrator.sample(Momentum::projected, end).ok());
  const Vector forces = forces_of_whole(integrator.scene(), end.time, end.q, end.lambda);
  ASSERT_EQ(forces.size(), 3);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(forces[k], (k + 1) * force / 14.0, 1e-12) << k;
  const Vector kept = forces_of_kept(integrator.scene(), end.time, end.q, forces);
  ASSERT_EQ(kept.size(), 1);
  EXPECT_NEAR(kept[0], end.lambda[0], 1e-12);
}

}  // namespace
}  // namespace diracstep
