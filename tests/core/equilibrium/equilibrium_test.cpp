#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/equilibrium/eigenmodes.hpp>
#include <diracstep/core/equilibrium/sparse_equilibrium.hpp>

namespace diracstep {
namespace {

constexpr double gravity = 9.81;

Scene scene_of(std::vector<std::string> names, std::shared_ptr<const Lagrangian> lagrangian, Vector q,
               Vector v) {
  Scene scene;
  scene.name = "test";
  scene.coordinates = std::move(names);
  scene.lagrangian = std::move(lagrangian);
  scene.start = {0.0, std::move(q), std::move(v)};
  return scene;
}

Scene pendulum(double angle) {
  return scene_of({"th"}, lagrangian<1>([](const auto& q, const auto& v) {
                    using std::cos;
                    return 0.5 * v[0] * v[0] + gravity * cos(q[0]);
                  }),
                  Vector::Constant(1, angle), Vector::Zero(1));
}

/// Unit mass on a rod of length 1 in Cartesian coordinates, z upwards.
Scene spherical_pendulum(Vector q, Vector v) {
  Scene scene = scene_of({"x", "y", "z"}, lagrangian<3>([](const auto& x, const auto& w) {
                           return 0.5 * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) - gravity * x[2];
                         }),
                         std::move(q), std::move(v));
  scene.constraints = {holonomic<3, 1>(
      []<class T>(const std::array<T, 3>& x) {
        return std::array<T, 1>{x[0] * x[0] + x[1] * x[1] + x[2] * x[2] - 1.0};
      },
      {"rod"})};
  return scene;
}

std::vector<std::complex<double>> eigenvalues(const Scene& scene, const Equilibrium& at) {
  std::vector<std::complex<double>> all;
  for (const Mode& mode : eigenmodes(linearise(scene, at, 1.0)).modes) all.push_back(mode.eigenvalue);
  return all;
}

TEST(Equilibrium, NewtonsPathLeadsToTheNextOneNotAnyone) {
  // From 1.5 Newton's method jumps by 14 rad; the path goes down to 0, and from 1.6 up to pi.
  EXPECT_NEAR(find_equilibrium(pendulum(1.5), pendulum(1.5).start).q[0], 0.0, 1e-13);
  EXPECT_NEAR(find_equilibrium(pendulum(1.6), pendulum(1.6).start).q[0], M_PI, 1e-13);
}

TEST(Equilibrium, WhereNewtonsPathEndsItRelaxes) {
  const Scene scene = spherical_pendulum(Vector{{1.0, 0.0, 0.0}}, Vector::Zero(3));
  const Equilibrium found = find_equilibrium(scene, scene.start);
  ASSERT_TRUE(found.ok()) << found.failure;
  EXPECT_NEAR(found.q[2], -1.0, 1e-13);
  EXPECT_NEAR(found.lambda[0], -gravity / 2.0, 1e-12);  // 2 z λ holds the weight
}

/// Two rows on one circle: off it they are independent, so that the directions allowed change on the way,
/// which may end there.
TEST(Equilibrium, RowsThatDependOnTheirSurfaceAloneEndTheWayInWords) {
  Scene scene = scene_of({"x", "y"}, lagrangian<2>([](const auto& x, const auto& w) {
                           return 0.5 * (w[0] * w[0] + w[1] * w[1]) - gravity * x[1];
                         }),
                         Vector{{1.0, 0.0}}, Vector::Zero(2));
  scene.constraints = {holonomic<2, 2>(
      []<class T>(const std::array<T, 2>& x) {
        const T off = x[0] * x[0] + x[1] * x[1] - 1.0;
        return std::array<T, 2>{off, off * (2.0 + x[0])};
      },
      {"rod", "again"})};
  const Equilibrium found = find_equilibrium(scene, scene.start);
  EXPECT_FALSE(found.ok());
  EXPECT_NE(found.failure.find("is left on 'y'"), std::string::npos) << found.failure;
}

TEST(Equilibrium, AHugeFirstCorrectionIsNoScale) {
  const Scene scene = pendulum(std::acos(0.0));  // the stiffness is 6e-17 of the force
  const Equilibrium at = find_equilibrium(scene, scene.start);
  ASSERT_TRUE(at.ok()) << at.failure;
  EXPECT_NEAR(std::sin(at.q[0]), 0.0, 1e-10);
}

TEST(Equilibrium, VibrationsOfThePendulumAboutBothEquilibria) {
  const double rate = std::sqrt(gravity);
  for (const double angle : {0.1, 3.0}) {
    const Scene scene = pendulum(angle);
    const Equilibrium at = find_equilibrium(scene, scene.start);
    const auto found = eigenvalues(scene, at);
    ASSERT_EQ(found.size(), angle < 1.0 ? 1U : 2U);
    if (angle < 1.0)
      EXPECT_LT(std::abs(found[0] - std::complex<double>(0.0, rate)), 1e-13);
    else
      EXPECT_NEAR(found[1].real(), rate, 1e-13);
  }
}

/// The rod also stated twice over: of Λ_1 + 2 Λ_2 = Λ the least are Λ/5 and 2 Λ/5.
TEST(Equilibrium, SparseMatricesLeaveOutRedundantRows) {
  const Scene once = spherical_pendulum(Vector{{0.1, 0.2, -std::sqrt(0.95)}}, Vector::Zero(3));
  Scene twice = once;
  twice.constraints.push_back(holonomic<3, 1>(
      []<class T>(const std::array<T, 3>& x) {
        return std::array<T, 1>{2.0 * (x[0] * x[0] + x[1] * x[1] + x[2] * x[2] - 1.0)};
      },
      {"again"}));
  const Equilibrium known = find_sparse_equilibrium(once), found = find_sparse_equilibrium(twice);
  ASSERT_TRUE(found.ok()) << found.failure;
  EXPECT_NEAR(found.q[2], -1.0, 1e-13);
  ASSERT_EQ(found.lambda.size(), 2);
  EXPECT_NEAR(found.lambda[0], known.lambda[0] / 5.0, 1e-11);
  EXPECT_NEAR(found.lambda[1], 2.0 * known.lambda[0] / 5.0, 1e-11);
}

TEST(Equilibrium, RowsAreReducedToTheDegreesOfFreedom) {
  const Scene scene = spherical_pendulum(Vector{{0.0, 0.6, -0.8}}, Vector::Zero(3));
  const Equilibrium at = find_equilibrium(scene, scene.start);
  const Linearisation linear = linearise(scene, at, 1.0);
  EXPECT_EQ(linear.mass.rows(), 2);
  EXPECT_TRUE(linear.conservative);
  for (const auto& eigenvalue : eigenvalues(scene, at))
    EXPECT_LT(std::abs(eigenvalue - std::complex<double>(0.0, std::sqrt(gravity))), 1e-12);
}

/// Spherical coordinates: th from below, ph about the vertical, which is cyclic.
Scene conical_pendulum(double angle, double rate) {
  return scene_of({"th", "ph"}, lagrangian<2>([](const auto& q, const auto& v) {
                    using std::cos, std::sin;
                    return 0.5 * (v[0] * v[0] + sin(q[0]) * sin(q[0]) * v[1] * v[1]) + gravity * cos(q[0]);
                  }),
                  Vector{{angle, 0.0}}, Vector{{0.0, rate}});
}

TEST(Equilibrium, SteadyMotionOfTheConicalPendulum) {
  constexpr double rate = 5.0;
  const Scene scene = conical_pendulum(1.0, rate);
  const Equilibrium at = find_equilibrium(scene, scene.start, true);
  ASSERT_TRUE(at.ok()) << at.failure;
  const double c = gravity / (rate * rate);  // cos th
  EXPECT_NEAR(std::cos(at.q[0]), c, 1e-13);
  EXPECT_EQ(at.v[1], rate);
  const Eigenmodes modes = eigenmodes(linearise(scene, at, 10.0));
  ASSERT_EQ(modes.modes.size(), 1U);
  EXPECT_EQ(modes.zeros, 2);  // ph and its rate
  EXPECT_NEAR(modes.modes[0].eigenvalue.imag(), rate * std::sqrt(1.0 + 3.0 * c * c), 1e-12);
  EXPECT_EQ(modes.stability, Stability::neutral);
  EXPECT_LT(linearise(scene, at, 10.0).variation, 1e-12);
}

TEST(Equilibrium, AMotionThatIsNotSteadyIsTold) {
  // The same in Cartesian coordinates goes round: what is linear about one point does not hold at the next.
  const double c = gravity / 25.0, s = std::sqrt(1.0 - c * c);
  const Scene scene = spherical_pendulum(Vector{{s, 0.0, -c}}, Vector{{0.0, 5.0 * s, 0.0}});
  EXPECT_GT(linearise(scene, {0.0, scene.start.q, scene.start.v, Vector::Zero(1)}, 1.0).variation, 0.1);
}

TEST(Equilibrium, ConstantRowsOnVelocitiesKeepWhatTheyKeepInEveryMotion) {
  // Two unit springs in a line of charge: x + y keeps its value 1, so both rest at 1/2.
  Scene scene = scene_of({"x", "y"}, lagrangian<2>([](const auto& q, const auto& v) {
                           return 0.5 * (v[0] * v[0] + v[1] * v[1] - q[0] * q[0] - q[1] * q[1]);
                         }),
                         Vector{{1.0, 0.0}}, Vector::Zero(2));
  scene.constraints = {pfaffian<2, 1>([]<class T>(const std::array<T, 2>&) {
    return std::array<std::array<T, 2>, 1>{{{T(1.0), T(1.0)}}};
  })};
  const Equilibrium at = find_equilibrium(scene, scene.start);
  ASSERT_TRUE(at.ok()) << at.failure;
  EXPECT_NEAR(at.q[0], 0.5, 1e-14);
  EXPECT_NEAR(at.q[1], 0.5, 1e-14);
}

TEST(Equilibrium, NonholonomicRowsLeaveMorePositionsThanVelocities) {
  // A skate with a spring in x and one about its heading, at rest: sideways it does not move at all.
  Scene scene = scene_of(
      {"x", "y", "ph"}, lagrangian<3>([](const auto& q, const auto& v) {
        return 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - 4.0 * q[0] * q[0] - 9.0 * q[2] * q[2]);
      }),
      Vector{{0.3, 0.2, 0.1}}, Vector::Zero(3));
  scene.constraints = {pfaffian<3, 1>([]<class T>(const std::array<T, 3>& q) {
    using std::cos, std::sin;
    return std::array<std::array<T, 3>, 1>{{{sin(q[2]), -cos(q[2]), T(0.0)}}};
  })};
  const Equilibrium at = find_equilibrium(scene, scene.start);
  ASSERT_TRUE(at.ok()) << at.failure;
  EXPECT_NEAR(at.q[1], 0.2, 1e-9);  // nothing asks for a change of y
  const Linearisation linear = linearise(scene, at, 1.0);
  EXPECT_EQ(linear.positions.cols(), 3);
  EXPECT_EQ(linear.velocities.cols(), 2);
  const Eigenmodes modes = eigenmodes(linear);
  EXPECT_EQ(modes.zeros, 1);
  ASSERT_EQ(modes.modes.size(), 2U);
  EXPECT_NEAR(modes.modes[0].eigenvalue.imag(), 2.0, 1e-12);
  EXPECT_NEAR(modes.modes[1].eigenvalue.imag(), 3.0, 1e-12);
}

/// On the circle of a sphere at which a row holds it: all of the weight is the force of that row, and what is
/// left along the circle is round-off of it, whose root is no rate.
TEST(Equilibrium, AFamilyUnderALoadIsNeutralAndNamesItsDirection) {
  Scene scene = spherical_pendulum(Vector{{0.8, 0.5, 0.31}}, Vector::Zero(3));
  scene.constraints.push_back(holonomic<3, 1>(
      []<class T>(const std::array<T, 3>& x) { return std::array<T, 1>{x[2] - 0.3}; }, {"level"}));
  const Equilibrium at = find_equilibrium(scene, scene.start);
  ASSERT_TRUE(at.ok()) << at.failure;
  EXPECT_NEAR(at.lambda[1], gravity, 1e-13);
  const Eigenmodes modes = eigenmodes(linearise(scene, at, 1.0));
  EXPECT_EQ(modes.zeros, 2);
  EXPECT_LT(modes.zeros_below, 1e-5);
  EXPECT_TRUE(modes.modes.empty());
  EXPECT_EQ(modes.stability, Stability::neutral);
  ASSERT_EQ(modes.free_directions.cols(), 1);
  EXPECT_NEAR(modes.free_directions(0, 0), -at.q[1] / at.q[0], 1e-12);
  EXPECT_NEAR(modes.free_directions(1, 0), 1.0, 1e-15);
}

/// y (1 + x²) = 0 holds a weight at each x, with the force g/(1 + x²).
TEST(Equilibrium, AFamilyWhoseForceChangesAlongItIsOne) {
  Scene scene = scene_of({"x", "y"}, lagrangian<2>([](const auto& x, const auto& w) {
                           return 0.5 * (w[0] * w[0] + w[1] * w[1]) - gravity * x[1];
                         }),
                         Vector{{0.8, 0.5}}, Vector::Zero(2));
  scene.constraints = {holonomic<2, 1>(
      []<class T>(const std::array<T, 2>& x) { return std::array<T, 1>{x[1] * (1.0 + x[0] * x[0])}; })};
  const Equilibrium at = find_equilibrium(scene, scene.start);
  ASSERT_TRUE(at.ok()) << at.failure;
  EXPECT_NEAR(at.lambda[0], gravity / (1.0 + at.q[0] * at.q[0]), 1e-12);
  const Linearisation linear = linearise(scene, at, 1.0);
  EXPECT_LT(linear.variation, 1e-10);
  const Eigenmodes modes = eigenmodes(linear);
  EXPECT_EQ(modes.zeros, 2);
  EXPECT_EQ(modes.stability, Stability::neutral);
  EXPECT_EQ(modes.free_directions.col(0), (Vector{{1.0, 0.0}}));
}

/// A disc that rolls upright, pulled by 3 along x: it rests where it heads across, ph = pi/2.
TEST(Equilibrium, ADiscRestsAcrossThePull) {
  Scene scene = scene_of({"x", "y", "th", "ph"}, lagrangian<4>([](const auto& q, const auto& v) {
                           return 0.5 * (v[0] * v[0] + v[1] * v[1]) + 0.25 * v[2] * v[2] +
                                  0.125 * v[3] * v[3] - 3.0 * q[0];
                         }),
                         Vector{{0.0, 1.0, 1.0, 0.3}}, Vector::Zero(4));
  scene.constraints = {pfaffian<4, 2>([]<class T>(const std::array<T, 4>& q) {
    using std::cos, std::sin;
    return std::array<std::array<T, 4>, 2>{
        {{T(1.0), T(0.0), -cos(q[3]), T(0.0)}, {T(0.0), T(1.0), -sin(q[3]), T(0.0)}}};
  })};
  const Equilibrium at = find_equilibrium(scene, scene.start);
  ASSERT_TRUE(at.ok()) << at.failure;
  EXPECT_NEAR(at.q[3], M_PI / 2.0, 1e-12);
  EXPECT_NEAR(at.lambda[0], 3.0, 1e-12);
  EXPECT_EQ(eigenmodes(linearise(scene, at, 1.0)).free_directions.cols(), 3);  // x, y and th
}

/// Two particles, one of them drawn away at the slow rate r: told from one that is free, also where both
/// coordinates are mixed, as long as r² is more than round-off of the other's.
TEST(Equilibrium, ASlowGrowthBesideAFastVibrationIsNoFreeDirection) {
  for (const double rate : {1e-5, 1e-6, 3e-8})
    for (const bool mixed : {false, true}) {
      const Scene scene =
          scene_of({"u", "w"}, lagrangian<2>([=](const auto& q, const auto& v) {
                     const auto a = mixed ? q[0] + q[1] : q[0], b = mixed ? q[0] - q[1] : q[1];
                     return 0.5 * (v[0] * v[0] + v[1] * v[1]) - 0.5 * a * a + 0.5 * rate * rate * b * b;
                   }),
                   Vector{{0.1, 0.0}}, Vector::Zero(2));
      const Eigenmodes modes = eigenmodes(linearise(scene, find_equilibrium(scene, scene.start), 1.0));
      const double grows = mixed ? std::sqrt(2.0) * rate : rate;
      if (mixed && rate < 1e-7) {  // rate² is round-off of 1
        EXPECT_EQ(modes.zeros, 2) << rate;
        EXPECT_GT(modes.zeros_below, grows);
        continue;
      }
      EXPECT_EQ(modes.zeros, 0) << rate << mixed;
      EXPECT_EQ(modes.stability, Stability::unstable) << rate << mixed;
      EXPECT_NEAR(modes.modes[1].eigenvalue.real(), grows, 1e-3 * grows) << rate << mixed;
    }
}

/// A weight held by a multiplier that is a coordinate, l (y − 1/2): l is the force.
TEST(Equilibrium, AMultiplierAmongTheCoordinatesHasItsForce) {
  const Scene scene =
      scene_of({"x", "y", "l"}, lagrangian<3>([](const auto& q, const auto& v) {
                 return 0.5 * (v[0] * v[0] + v[1] * v[1]) - gravity * q[1] + q[2] * (q[1] - 0.5);
               }),
               Vector{{0.8, 0.5, 0.0}}, Vector::Zero(3));
  const Equilibrium at = find_equilibrium(scene, scene.start);
  ASSERT_TRUE(at.ok()) << at.failure;
  EXPECT_NEAR(at.q[2], gravity, 1e-13);
  EXPECT_EQ(eigenmodes(linearise(scene, at, 1.0)).zeros, 2);
}

TEST(Equilibrium, WhereThereIsNoneTheForceThatIsLeftIsNamed) {
  const Scene scene =
      scene_of({"height"},
               lagrangian<1>([](const auto& q, const auto& v) { return 0.5 * v[0] * v[0] - gravity * q[0]; }),
               Vector::Ones(1), Vector::Zero(1));
  const Equilibrium found = find_equilibrium(scene, scene.start);
  EXPECT_FALSE(found.ok());
  EXPECT_NE(found.failure.find("-9.81 is left on 'height'"), std::string::npos) << found.failure;
}

TEST(Equilibrium, AFrictionThatFeedsEnergyIsUnstableAndOneThatTakesItStable) {
  for (const double damping : {-0.2, 0.2}) {
    Scene scene = pendulum(0.3);
    scene.force = force<1>([damping]<class T>(const std::array<T, 1>&, const std::array<T, 1>& v) {
      return std::array<T, 1>{-damping * v[0]};
    });
    const Eigenmodes modes = eigenmodes(linearise(scene, find_equilibrium(scene, scene.start), 1.0));
    EXPECT_EQ(modes.stability, damping > 0.0 ? Stability::asymptotic : Stability::unstable);
    EXPECT_NEAR(modes.modes[0].eigenvalue.real(), -damping / 2.0, 1e-13);
    EXPECT_NEAR(modes.modes[0].eigenvalue.imag(), std::sqrt(gravity - damping * damping / 4.0), 1e-13);
  }
}

}  // namespace
}  // namespace diracstep
