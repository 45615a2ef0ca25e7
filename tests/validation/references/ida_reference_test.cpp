#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <stdexcept>
#include <string>

#include "reference_scenes.hpp"

namespace diracstep {
namespace {

using namespace reference_scenes;

// ------------------------------------------------------------------------------ catalogue scenes

struct Bounds {
  const char* scene;
  std::array<double, 3>
      error;  ///< five times the errors measured at rtol 1e-6, 1e-8, 1e-10 at the catalogue's end
};

class Catalogue : public ::testing::TestWithParam<Bounds> {};

TEST_P(Catalogue, ErrorFallsWithTheTolerance) {
  const CatalogueScene entry = make_scene(GetParam().scene);
  double first = infinite, last = infinite, rtol = 1e-6;
  for (const double bound : GetParam().error) {
    const ReferenceRun run = integrate_with_ida(*entry.scene, entry.t_end, at(rtol));
    ASSERT_TRUE(run.ok()) << run.failure;
    EXPECT_EQ(run.end.time, entry.t_end);
    const double reached = error(entry, run.end);
    EXPECT_LT(reached, bound) << "rtol " << rtol;
    // The rows are equations of the system: only the Newton iteration's tolerance is left in them.
    EXPECT_LT(row_residual(*entry.scene, run.end), rtol) << "rtol " << rtol;
    if (first == infinite) first = reached;
    last = reached;
    rtol *= 1e-2;
  }
  // A single tolerance may be lucky: the round-off of the start alone moves its error tenfold.
  EXPECT_LT(last, 1e-2 * first);
}

TEST_P(Catalogue, EveryToleranceCompletes) {
  const CatalogueScene entry = make_scene(GetParam().scene);
  for (int digits = 1; digits <= 14; ++digits) {
    const ReferenceRun run = integrate_with_ida(*entry.scene, 2.0, at(std::pow(10.0, -digits)));
    EXPECT_TRUE(run.ok()) << "rtol 1e-" << digits << ": " << run.failure;
    if (digits < 4) continue;
    // A wrong block of the Jacobian shows here as well; measured with the right one: at most 2.8 and 0.4 per
    // step.
    EXPECT_LT(run.newton_iterations, 3 * run.steps) << "rtol 1e-" << digits;
    EXPECT_LT(2 * run.jacobian_evaluations, run.steps) << "rtol 1e-" << digits;
  }
}

TEST_P(Catalogue, EndIsConsistentWithItself) {
  const CatalogueScene entry = make_scene(GetParam().scene);
  const Scene& scene = *entry.scene;
  const ReferenceRun run = integrate_with_ida(scene, 1.0, at(1e-8));
  ASSERT_TRUE(run.ok()) << run.failure;
  Vector force(scene.dimension()), momentum(scene.dimension());
  scene.lagrangian->gradient(1.0, run.end.q, run.end.v, force, momentum);
  EXPECT_EQ(run.end.p, momentum);
  EXPECT_EQ(run.end.lambda.size(), scene.rows());
  EXPECT_EQ(run.end.energy, scene.energy(1.0, run.end.q, run.end.v));
  EXPECT_NEAR(run.end.energy, scene.energy(0.0, scene.start.q, scene.start.v), 1e-5);
  EXPECT_GT(run.cpu_seconds, 0.0);
  EXPECT_GE(run.residual_evaluations, run.newton_iterations);
}

INSTANTIATE_TEST_SUITE_P(Ida, Catalogue,
                         ::testing::Values(Bounds{"kepler_e06", {1.2, 2.5e-2, 4e-4}},
                                           Bounds{"knife_edge", {7e-5, 4e-6, 5e-8}},
                                           Bounds{"nonholonomic_particle_free", {8e-5, 1.6e-6, 6e-8}},
                                           Bounds{"pendulum_cartesian", {2.7e-2, 1.3e-4, 2.6e-6}}),
                         [](const auto& test) { return std::string(test.param.scene); });

TEST(IdaReference, ForceOfTheKnifeEdgeIsTheClosedForm) {
  const CatalogueScene entry = make_scene("knife_edge");
  for (const double t : {0.5, 2.0, 10.0}) {
    const ReferenceRun run = integrate_with_ida(*entry.scene, t, at(1e-10));
    ASSERT_TRUE(run.ok()) << run.failure;
    ASSERT_EQ(run.end.lambda.size(), 1);
    const double slope = entry.parameters.at("g_sin_alpha");
    EXPECT_NEAR(run.end.lambda[0], -2.0 * slope * std::sin(t), 1e-7);  // ten times the error of v there
  }
}

/// A pendulum released in motion is where stabilised holonomic rows stall at tight tolerances.
TEST(IdaReference, MovingStartsOfThePendulumComplete) {
  const CatalogueScene entry = make_scene("pendulum_cartesian");
  for (const double angle : {0.1, 1.0, 3.0})
    for (const double speed : {0.0, 1e-6, 1.0, 7.0, 30.0})
      for (const double rtol : {1e-8, 1e-12, 1e-13, 1e-14}) {
        Scene scene = *entry.scene;
        scene.start.q << std::sin(angle), -std::cos(angle);
        scene.start.v << speed * std::cos(angle), speed * std::sin(angle);
        const ReferenceRun run = integrate_with_ida(scene, 0.5, at(rtol));
        ASSERT_TRUE(run.ok()) << "angle " << angle << ", speed " << speed << ": " << run.failure;
        EXPECT_LT(run.steps, 20'000) << "angle " << angle << ", speed " << speed << ", rtol " << rtol;
        EXPECT_LT(row_residual(scene, run.end), 10.0 * rtol * std::max(1.0, speed));
      }
}

// ------------------------------------------------------------------------------ time-dependent and large
// closed forms

TEST(IdaReference, FollowsAffineRowsThatDependOnTime) {
  const ReferenceRun run = integrate_with_ida(driven_particle(), 5.0, at(1e-10));
  ASSERT_TRUE(run.ok()) << run.failure;
  EXPECT_NEAR(run.end.q[0], std::cos(5.0) - 1.0, 1e-7);
  EXPECT_NEAR(run.end.q[1], 5.0, 1e-7);
  EXPECT_NEAR(run.end.v[0], -std::sin(5.0), 1e-7);
  EXPECT_NEAR(run.end.lambda[0], -std::cos(5.0), 1e-7);
}

TEST(IdaReference, FollowsHolonomicRowsThatDependOnTime) {
  const ReferenceRun run = integrate_with_ida(bead_on_turning_line(), 2.0, at(1e-10));
  ASSERT_TRUE(run.ok()) << run.failure;
  const double r = std::cosh(2.0), rate = std::sinh(2.0), c = std::cos(2.0), s = std::sin(2.0);
  EXPECT_NEAR(run.end.q[0], r * c, 1e-7);
  EXPECT_NEAR(run.end.q[1], r * s, 1e-7);
  EXPECT_NEAR(run.end.v[0], rate * c - r * s, 1e-7);
  EXPECT_NEAR(run.end.v[1], rate * s + r * c, 1e-7);
  EXPECT_NEAR(run.end.lambda[0], 2.0 * rate, 1e-7);
}

TEST(IdaReference, FollowsALagrangianThatDependsOnTime) {
  const ReferenceRun run = integrate_with_ida(damped_oscillator(), 3.0, at(1e-10));
  ASSERT_TRUE(run.ok()) << run.failure;
  const double w = std::sqrt(0.75), decay = std::exp(-1.5);
  const double q = decay * (std::cos(3.0 * w) + std::sin(3.0 * w) / (2.0 * w));
  const double v = -decay * std::sin(3.0 * w) / w;
  EXPECT_NEAR(run.end.q[0], q, 1e-7);
  EXPECT_NEAR(run.end.v[0], v, 1e-7);
  EXPECT_NEAR(run.end.p[0], std::exp(3.0) * v, 1e-6);
}

/// A massless charge on a spring: L = (x v_y − y v_x)/2 − |q|²/2, x' = −y, y' = x; the start gives no
/// velocity, or one that is not that of the motion.
TEST(IdaReference, FindsTheVelocityThatALagrangianLinearInItDetermines) {
  const auto formula = []<class T>(const std::array<T, 2>& q, const std::array<T, 2>& v) {
    return 0.5 * (q[0] * v[1] - q[1] * v[0]) - 0.5 * (q[0] * q[0] + q[1] * q[1]);
  };
  for (const double given : {0.0, 7.0}) {
    const ReferenceRun run =
        integrate_with_ida(make<2>(formula, {}, {1.0, 0.0}, {given, given}), 2.0, at(1e-10));
    ASSERT_TRUE(run.ok()) << run.failure;
    const double s = std::sin(2.0), c = std::cos(2.0);
    EXPECT_NEAR(run.end.q[0], c, 1e-7);
    EXPECT_NEAR(run.end.q[1], s, 1e-7);
    EXPECT_NEAR(run.end.v[0], -s, 1e-6);
    EXPECT_NEAR(run.end.v[1], c, 1e-6);
  }
}

TEST(IdaReference, TakesAHamiltonianAndAMomentumInstead) {
  Scene scene = make<1>(UnitMass{}, {}, {1.0}, {0.0});
  scene.lagrangian = nullptr;
  scene.hamiltonian = hamiltonian<1>([]<class T>(const std::array<T, 1>& q, const std::array<T, 1>& p) {
    return 0.5 * (p[0] * p[0] + q[0] * q[0]);
  });
  scene.start.p = scene.start.v;
  scene.start.v = {};
  const ReferenceRun run = integrate_with_ida(scene, 3.0, at(1e-10));
  ASSERT_TRUE(run.ok()) << run.failure;
  EXPECT_NEAR(run.end.q[0], std::cos(3.0), 1e-7);
  EXPECT_NEAR(run.end.p[0], -std::sin(3.0), 1e-7);
}

TEST(IdaReference, SolvesLargeScenesOnASparsePattern) {
  const Scene scene = tied_oscillators();
  const ReferenceRun run = integrate_with_ida(scene, 2.0, at(1e-10));
  ASSERT_TRUE(run.ok()) << run.failure;
  for (int i = 0; i < tied; ++i) {
    const int pair = i / 2;
    const double stiffness = 2.0 * pair + 1.5;  // the mean of the pair
    EXPECT_NEAR(run.end.q[i], std::cos(2.0 * std::sqrt(stiffness)), 1e-7) << i;
  }
}

/// q̈ + q̇ + q = 0 again, the damping as a force.
TEST(IdaReference, FollowsForces) {
  const auto formula = []<class T>(const std::array<T, 1>& q, const std::array<T, 1>& v) {
    return 0.5 * (v[0] * v[0] - q[0] * q[0]);
  };
  Scene scene = make<1>(formula, {}, {1.0}, {0.0});
  scene.force = force<1>(
      []<class T>(const std::array<T, 1>&, const std::array<T, 1>& v) { return std::array<T, 1>{-v[0]}; });
  const ReferenceRun run = integrate_with_ida(scene, 3.0, at(1e-10));
  const ReferenceRun same = integrate_with_ida(damped_oscillator(), 3.0, at(1e-10));
  ASSERT_TRUE(run.ok()) << run.failure;
  EXPECT_NEAR(run.end.q[0], same.end.q[0], 1e-7);
  EXPECT_NEAR(run.end.v[0], same.end.v[0], 1e-7);
}

TEST(IdaReference, AbsoluteToleranceIsUsed) {
  const CatalogueScene entry = make_scene("pendulum_cartesian");
  ReferenceOptions coarse = at(1e-10);
  coarse.atol = 1e-4;
  const ReferenceRun fine = integrate_with_ida(*entry.scene, 2.0, at(1e-10));
  const ReferenceRun run = integrate_with_ida(*entry.scene, 2.0, coarse);
  ASSERT_TRUE(run.ok()) << run.failure;
  EXPECT_LT(3 * run.steps, fine.steps);
  EXPECT_GT(error(entry, run.end), 100.0 * error(entry, fine.end));
}

// ------------------------------------------------------------------------------ misuse and failures

TEST(IdaReference, BadOptionsAreMisuse) {
  const Scene scene = damped_oscillator();
  for (const double rtol : {0.0, 9e-15, 0.2, -1e-6, not_a_number})
    EXPECT_THROW((void)integrate_with_ida(scene, 1.0, at(rtol)), Misuse) << rtol;
  for (const double t_end : {0.0, -1.0, infinite, not_a_number})
    EXPECT_THROW((void)integrate_with_ida(scene, t_end, at(1e-6)), Misuse) << t_end;
  for (const double atol : {-1e-6, infinite, not_a_number}) {
    ReferenceOptions options;
    options.atol = atol;
    EXPECT_THROW((void)integrate_with_ida(scene, 1.0, options), Misuse) << atol;
  }
  ReferenceOptions no_steps;
  no_steps.max_steps = 0;
  EXPECT_THROW((void)integrate_with_ida(scene, 1.0, no_steps), Misuse);
}

TEST(IdaReference, BadScenesAreMisuse) {
  Scene wrong_size = damped_oscillator();
  wrong_size.start.v = Vector::Zero(2);
  EXPECT_THROW((void)integrate_with_ida(wrong_size, 1.0, {}), Misuse);
  Scene off_the_row = bead_on_turning_line();
  off_the_row.start.q[1] = 0.1;
  EXPECT_THROW((void)integrate_with_ida(off_the_row, 1.0, {}), Misuse);
}

TEST(IdaReference, TooManyStepsAreAFailureThatKeepsTheState) {
  const CatalogueScene entry = make_scene("pendulum_cartesian");
  ReferenceOptions options = at(1e-8);
  options.max_steps = 200;
  ::testing::internal::CaptureStderr();
  const ReferenceRun run = integrate_with_ida(*entry.scene, entry.t_end, options);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_FALSE(run.ok());
  EXPECT_NE(run.failure.find("IDA_TOO_MUCH_WORK at t = "), std::string::npos) << run.failure;
  EXPECT_EQ(run.steps, 200);
  EXPECT_GT(run.end.time, 0.1);
  EXPECT_LT(run.end.time, entry.t_end);
  EXPECT_LT(error(entry, run.end), 1e-5);
}

/// q reaches 1 in motion; L is not defined beyond.
TEST(IdaReference, LeavingTheDomainIsAFailure) {
  const auto formula = []<class T>(const std::array<T, 1>& q, const std::array<T, 1>& v) {
    using std::sqrt;
    const T w = 1.0 - q[0];
    return 0.5 * v[0] * v[0] - w * w * sqrt(w);
  };
  ReferenceOptions options = at(1e-6);
  options.max_steps = 5'000;  // it creeps towards the boundary with ever shorter steps
  const ReferenceRun run = integrate_with_ida(make<1>(formula, {}, {0.0}, {1.0}), 10.0, options);
  EXPECT_EQ(run.failure.find("IDA_"), 0U) << run.failure;
  EXPECT_GT(run.end.time, 0.1);
  EXPECT_NEAR(run.end.q[0], 1.0, 1e-4);
  EXPECT_TRUE(run.end.q.allFinite() && run.end.v.allFinite());
}

TEST(IdaReference, RedundantRowsAreAFailureAtTheStart) {
  Scene scene = driven_particle();
  scene.constraints.push_back(scene.constraints.front());
  const ReferenceRun run = integrate_with_ida(scene, 1.0, {});
  EXPECT_EQ(run.failure.find("start: "), 0U) << run.failure;
  EXPECT_EQ(run.end.time, 0.0);
  EXPECT_EQ(run.end.q, scene.start.q);
}

TEST(IdaReference, ExceptionsOfTheSceneComeThrough) {
  const auto formula = []<class T>(const std::array<T, 1>& q, const std::array<T, 1>& v) {
    const T energy = 0.5 * v[0] * v[0];
    if (q[0] > T(0.5)) throw std::domain_error("beyond the table");
    return energy;
  };
  EXPECT_THROW((void)integrate_with_ida(make<1>(formula, {}, {0.0}, {1.0}), 10.0, {}), std::domain_error);
}

TEST(IdaReference, RunsAreReproducibleBitByBit) {
  const CatalogueScene entry = make_scene("knife_edge");
  const ReferenceRun one = integrate_with_ida(*entry.scene, 5.0, at(1e-9));
  const ReferenceRun two = integrate_with_ida(*entry.scene, 5.0, at(1e-9));
  EXPECT_EQ(one.end.q, two.end.q);
  EXPECT_EQ(one.end.v, two.end.v);
  EXPECT_EQ(one.steps, two.steps);
}

}  // namespace
}  // namespace diracstep
