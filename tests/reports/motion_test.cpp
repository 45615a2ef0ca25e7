#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/reports/motion.hpp>

namespace diracstep {
namespace {

TEST(Motion, FindsTheBarOfAPendulumAndItsPin) {
  const DrawnMotion motion = motion_of(make_scene("pendulum_cartesian"));
  EXPECT_EQ(motion.form, DrawnMotion::Form::plane);
  ASSERT_EQ(motion.bodies.size(), 1u);
  ASSERT_EQ(motion.pins.size(), 1u);
  EXPECT_NEAR(motion.pins[0][0], 0.0, 1e-12);
  EXPECT_NEAR(motion.pins[0][1], 0.0, 1e-12);
  ASSERT_EQ(motion.bars.size(), 1u);
  EXPECT_EQ(motion.bars[0].from, 0);
  EXPECT_EQ(motion.bars[0].to, -1);
  EXPECT_EQ(motion.coordinates[0].unit, "m");
}

TEST(Motion, FindsEveryLinkOfAChainAndTheBarsBetweenMovingJoints) {
  const DrawnMotion chain = motion_of(make_scene("hanging_chain", {{"N", 7.0}}));
  EXPECT_EQ(chain.bodies.size(), 7u);
  EXPECT_EQ(chain.bars.size(), 7u);
  EXPECT_EQ(chain.pins.size(), 1u);
  const DrawnMotion windows = motion_of(make_scene("n_four_bar", {{"N", 3.0}}));
  EXPECT_EQ(windows.bodies.size(), 4u);
  ASSERT_EQ(windows.pins.size(), 4u);
  for (std::size_t j = 0; j < 4; ++j) EXPECT_NEAR(windows.pins[j][0], static_cast<double>(j), 1e-12);
  EXPECT_EQ(windows.bars.size(), 7u);
}

TEST(Motion, TakesNoRowForABarThatIsNone) {
  EXPECT_TRUE(motion_of(make_scene("ball_turntable")).bars.empty());  // |quaternion| = 1, rolling
  EXPECT_TRUE(motion_of(make_scene("kepler_e06")).bars.empty());
}

TEST(Motion, PointsTheWayOfAHeading) {
  const DrawnMotion skate = motion_of(make_scene("knife_edge"));
  ASSERT_EQ(skate.bodies.size(), 1u);
  ASSERT_GE(skate.bodies[0].heading, 0);
  EXPECT_EQ(skate.coordinates[static_cast<std::size_t>(skate.bodies[0].heading)].name, "ph");
  EXPECT_EQ(motion_of(make_scene("pendulum_cartesian")).bodies[0].heading, -1);
}

TEST(Motion, DrawsBodiesInSpace) {
  const DrawnMotion satellite = motion_of(make_scene("satellite"));
  EXPECT_EQ(satellite.form, DrawnMotion::Form::space);
  ASSERT_EQ(satellite.solids.size(), 2u);
  EXPECT_EQ(satellite.solids[0].shape, "ellipsoid");  // of its inertia
  EXPECT_NEAR(satellite.solids[0].size[0], std::sqrt(2.5 * (10.0 + 12.0 - 8.0) / 50.0), 1e-12);
  EXPECT_EQ(satellite.solids[1].shape, "disc");
  EXPECT_EQ(satellite.solids[1].size[0], 0.15);
  ASSERT_EQ(satellite.solids[1].places.size(), 7u);
  EXPECT_EQ(satellite.coordinates[static_cast<std::size_t>(satellite.solids[1].places[0])].name, "wheel_x");
  EXPECT_EQ(motion_of(make_scene("snakeboard")).solids[2].places.size(), 3u);
}

TEST(Motion, DrawsALongFamilyAsAProfileAndBoundsIt) {
  const DrawnMotion lattice = motion_of(make_scene("toda_200"));
  EXPECT_EQ(lattice.form, DrawnMotion::Form::profile);
  EXPECT_EQ(lattice.coordinates.size(), 200u);
  const DrawnMotion large = motion_of(make_scene("toda_200", {{"N", 5000.0}}));
  EXPECT_LE(large.coordinates.size(), 256u);
  EXPECT_GT(large.coordinates.back().index, 4900);
}

TEST(Motion, ElseDrawsTwoCoordinatesInAPlaneAndMoreOverTime) {
  EXPECT_EQ(motion_of(make_scene("lotka_volterra_2d")).form, DrawnMotion::Form::plane);
  const DrawnMotion curves = motion_of(make_scene("rigid_body_quat"));
  EXPECT_EQ(curves.form, DrawnMotion::Form::curves);
  EXPECT_EQ(curves.coordinates.size(), 4u);
}

TEST(TimeUnit, IsReadOffTheUnitsOfASceneAndElseUnknown) {
  EXPECT_EQ(time_unit(make_scene("pendulum_cartesian").notes), "s");
  EXPECT_EQ(time_unit(make_scene("outer_solar_system").notes), "d");
  EXPECT_EQ(time_unit(make_scene("kepler_e06").notes), "1");
  EXPECT_EQ(time_unit({{"x", "m", ""}}), "");
  EXPECT_EQ(time_unit({{"angle", "rad", ""}, {"m1", "", ""}}), "");
  EXPECT_EQ(time_unit({{"x", "rads", ""}}), "");  // no symbol inside of a word
}

}  // namespace
}  // namespace diracstep
