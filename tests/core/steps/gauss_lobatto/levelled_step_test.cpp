#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/detail/constraint_levels.hpp>

#include "differences.hpp"
#include "levelled_cases.hpp"
#include "methods.hpp"
#include "misuse.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::DegenerateCase;
using testing::distance;
using testing::expect_misuse;
using testing::gl;
using testing::levelled_cases;
using testing::samples_of;

TEST(LevelledStep, OrderIsTwiceTheStages) {
  for (const DegenerateCase& that : levelled_cases())
    for (const auto& [s, steps] : {std::pair{1, 20L}, {2, 5L}, {3, 4L}}) {
      const double first = testing::error_at_end(that, gl(s), steps),
                   second = testing::error_at_end(that, gl(s), 2 * steps);
      EXPECT_GT(second, 3e-12) << that.scene->name << ": at round-off, nothing is measured";
      EXPECT_NEAR(std::log2(first / second), 2.0 * s, 0.45)
          << that.scene->name << " s = " << s << " errors " << first << " " << second;
    }
}

TEST(LevelledStep, OrderWithConstraintsOfTwoLevels) {
  const DegenerateCase that = testing::lagging_servo();
  EXPECT_EQ(first_order_motions(*that.scene).levels.count, 2);
  for (const auto& [s, steps] : {std::pair{1, 4L}, {2, 2L}}) {
    const double first = testing::error_at_end(that, gl(s), steps),
                 second = testing::error_at_end(that, gl(s), 2 * steps);
    EXPECT_NEAR(std::log2(first / second), 2.0 * s, 0.45) << s << " errors " << first << " " << second;
  }
}

TEST(LevelledStep, OrderWithConstraintsOfThreeLevels) {
  const DegenerateCase that = testing::canonical_pendulum_by_multiplier();
  EXPECT_EQ(first_order_motions(*that.scene).levels.count, 3);
  for (const auto& [s, steps] : {std::pair{1, 20L}, {2, 5L}, {3, 4L}}) {
    const double first = testing::error_at_end(that, gl(s), steps),
                 second = testing::error_at_end(that, gl(s), 2 * steps);
    EXPECT_NEAR(std::log2(first / second), 2.0 * s, 0.3) << s << " errors " << first << " " << second;
  }
}

/// Five constraints tell all of five coordinates, so that what is left is round-off of the differences.
TEST(LevelledStep, FollowsConstraintsOfFiveLevels) {
  const DegenerateCase that = testing::far_servo();
  EXPECT_EQ(first_order_motions(*that.scene).levels.count, 5);
  EXPECT_LT(testing::error_at_end(that, gl(2), 5), 1e-7);
}

TEST(LevelledStep, JacobianAgreesWithDifferences) {
  for (const DegenerateCase& that : levelled_cases())
    for (const int s : {1, 2}) {
      const auto scene = completed(that.scene);
      const Eigen::Index n = scene->dimension();
      const auto problem = Registry::with_built_ins().method(gl(s)).make_step(*scene, {true});
      Vector p(n), lq(n), x(problem->size());
      scene->lagrangian->gradient(0.0, scene->start.q, scene->start.v, lq, p);
      problem->begin({0.0, 0.2}, {scene->start.q, p, scene->start.v}, {});
      problem->guess(scene->start.v, x);
      // The multipliers of the projection stay zero: how their directions turn is left out of the Jacobian.
      const Eigen::Index moved = x.size() - problem->blocks().back().rows;
      x.head(moved) += 0.1 * Vector::LinSpaced(moved, -1.0, 1.3);
      EXPECT_LT(testing::jacobian_error(*problem, x), 1e-5) << scene->name << " s = " << s;
    }
}

TEST(LevelledStep, KeepsAllConstraints) {
  for (const DegenerateCase& that : levelled_cases()) {
    const auto samples = samples_of(that.scene, {.method = gl(2), .step = 0.05}, 40);
    const FirstOrderMotions motions = first_order_motions(*that.scene);
    ASSERT_FALSE(motions.levels.empty()) << that.scene->name;
    LevelledEquations equations(*that.scene, motions);
    for (const Sample& at : samples) {
      Vector w(at.v.size() + at.lambda.size());
      w << at.v, at.lambda;
      LevelledPoint there;
      ASSERT_TRUE(equations.begin(at.time, equations.state(at.q, at.p), at.v, there));
      EXPECT_LT(max_norm(there.constraints), 1e-12) << that.scene->name << " t = " << at.time;
      EXPECT_LT(distance(there.w.head(w.size()), w), 1e-11) << that.scene->name;
    }
  }
}

/// One step there and one back by the same problem: another start may choose other equations to keep, which
/// differ off the constraints.
TEST(LevelledStep, IsSelfAdjoint) {
  for (const DegenerateCase& that : levelled_cases())
    for (const int s : {1, 2, 3}) {
      const auto scene = completed(that.scene);
      const Eigen::Index n = scene->dimension();
      const auto problem = Registry::with_built_ins().method(gl(s)).make_step(*scene, {true});
      StepEnd end;
      Vector lq(n), x(problem->size());
      end.at = {scene->start.q, Vector(n), scene->start.v};
      scene->lagrangian->gradient(0.0, end.at.q, end.at.v, lq, end.at.p);
      for (const Interval step : {Interval{0.0, 0.1}, Interval{0.1, -0.1}}) {
        const State start = end.at;
        problem->begin(step, start, {});
        problem->guess(start.v, x);
        ASSERT_TRUE(kinsol()(*problem)->solve(x).ok()) << scene->name << " s = " << s;
        problem->finish(x, end);
      }
      EXPECT_LT(distance(end.at.q, scene->start.q), 1e-14) << scene->name << " s = " << s;
    }
}

TEST(LevelledStep, GoesAllTheWayRound) {
  const auto samples = samples_of(testing::canonical_pendulum().scene, {.method = gl(3), .step = 0.1}, 100);
  for (const Sample& at : samples) {
    EXPECT_NEAR(at.q.head(2).norm(), 1.0, 1e-13) << at.time;
    EXPECT_NEAR(at.energy, samples.front().energy, 1e-6) << at.time;
  }
}

/// The same motion by the Hamiltonian, where a row between positions needs no algorithm.
TEST(LevelledStep, CanonicalCoordinatesMoveAsTheHamiltonianDoes) {
  Scene scene = testing::scene_of("by H", {"x", "y"});
  scene.hamiltonian =
      hamiltonian<2>([](const auto& q, const auto& p) { return 0.5 * (p[0] * p[0] + p[1] * p[1]) + q[1]; });
  scene.constraints = {holonomic<2, 1>(
      []<class T>(const std::array<T, 2>& q) { return std::array<T, 1>{q[0] * q[0] + q[1] * q[1] - 1.0}; })};
  scene.start.q = Vector{{1.0, 0.0}};
  scene.start.p = Vector{{0.0, 0.6}};
  const IntegratorOptions options{.method = gl(4), .step = 0.05};
  const Sample by_h = samples_of(std::make_shared<const Scene>(scene), options, 10).back(),
               by_l = samples_of(testing::canonical_pendulum().scene, options, 10).back();
  EXPECT_LT(distance(by_h.q, by_l.q.head(2)), 1e-11);
  EXPECT_LT(distance(by_h.p, by_l.q.tail(2)), 1e-11);
  EXPECT_NEAR(by_h.lambda[0], by_l.lambda[0], 1e-10);
}

TEST(LevelledStep, StartsOffTheConstraintsAreToldAndMoved) {
  Scene off = *testing::canonical_pendulum().scene;
  off.start.q[2] = 0.2;  // along the rod
  const auto take = [&](bool project) {
    return Integrator(std::make_shared<const Scene>(off), Registry::with_built_ins(), kinsol(),
                      {.method = gl(2), .step = 0.1, .project_start = project});
  };
  expect_misuse([&] { (void)take(false); }, {"'canonical pendulum'", "'rod'", "positions and momenta"});
  const Vector moved = take(true).position();
  EXPECT_LT(std::abs(moved[0] * moved[0] + moved[1] * moved[1] - 1.0), 1e-13);
  EXPECT_LT(std::abs(moved[0] * moved[2] + moved[1] * moved[3]), 1e-13);
  EXPECT_LT(distance(moved, off.start.q), 0.2);
}

/// All of x = l = 1 and y = 0 follows from the equations: at the only point there is nothing moves, which is
/// no reason to see no constraints.
TEST(LevelledStep, StartsOffTheOnlyPointThatIsAllowedAreTold) {
  Scene off = testing::scene_of("held", {"x", "y", "l"});
  off.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return q[1] * v[0] - q[0] * v[1] - 0.5 * (q[0] * q[0] + q[1] * q[1]) + q[2] * (q[0] - 1.0);
  });
  for (const Vector& q : {Vector{{1.0, 0.0, 0.2}}, Vector{{0.9, 0.0, 0.2}}, Vector{{1.0, 0.3, 1.0}}}) {
    off.start = {0.0, q, Vector::Zero(3)};
    const auto take = [&](bool project) {
      return Integrator(std::make_shared<const Scene>(off), Registry::with_built_ins(), kinsol(),
                        {.method = gl(2), .step = 0.1, .project_start = project});
    };
    const std::string allowed = q[2] == 1.0 ? "y from 0.3 to" : "l from 0.2 to 1";
    expect_misuse([&] { (void)take(false); }, {"'held'", "the equation of motion along 'l'", allowed});
    EXPECT_LT(distance(take(true).position(), Vector{{1.0, 0.0, 1.0}}), 1e-12);
  }
}

TEST(LevelledStep, ContradictionsAreToldWithAnEquation) {
  Scene scene = testing::scene_of("two walls", {"x", "p", "a", "b"});
  scene.lagrangian = lagrangian<4>([](const auto& q, const auto& v) {
    return q[1] * v[0] - 0.5 * q[1] * q[1] + q[2] * (q[0] - 1.0) + q[3] * (q[0] - 2.0);
  });
  scene.start = {0.0, Vector{{1.0, 0.0, 0.0, 0.0}}, Vector::Zero(4)};
  expect_misuse(
      [&] {
        (void)Integrator(std::make_shared<const Scene>(scene), Registry::with_built_ins(), kinsol(),
                         {.method = gl(2), .step = 0.1});
      },
      {"'two walls'", "the equation of motion along '", "contradict each other"});
}

TEST(LevelledStep, TwoMultipliersOfOneRowAreNamed) {
  Scene scene = testing::scene_of("twice", {"x", "y", "p", "r", "a", "b"});
  scene.lagrangian = lagrangian<6>([](const auto& q, const auto& v) {
    const auto rod = q[0] * q[0] + q[1] * q[1] - 1.0;
    return q[2] * v[0] + q[3] * v[1] - 0.5 * (q[2] * q[2] + q[3] * q[3]) - q[1] + (q[4] + q[5]) * rod;
  });
  scene.start = {0.0, Vector{{1.0, 0.0, 0.0, 0.6, 0.0, -0.18}}, Vector::Zero(6)};
  expect_misuse(
      [&] {
        (void)Integrator(std::make_shared<const Scene>(scene), Registry::with_built_ins(), kinsol(),
                         {.method = gl(2), .step = 0.1});
      },
      {"'twice'", "the velocity along 'a-b'", "there twice"});
}

TEST(LevelledStep, WhatNothingDeterminesIsRefusedWithItsDirection) {
  Scene scene = testing::scene_of("gauge", {"x", "p", "z"});  // nothing tells z
  scene.lagrangian = lagrangian<3>(
      [](const auto& q, const auto& v) { return q[1] * v[0] - 0.5 * (q[0] * q[0] + q[1] * q[1]); });
  scene.force = force<3>([]<class T>(const std::array<T, 3>&, const std::array<T, 3>& v) {
    return std::array<T, 3>{-0.1 * v[0], T(0.0), T(0.0)};
  });
  scene.start = {0.0, Vector{{0.3, 0.4, 0.0}}, Vector::Zero(3)};
  expect_misuse(
      [&] {
        (void)Integrator(std::make_shared<const Scene>(scene), Registry::with_built_ins(), kinsol(),
                         {.method = gl(2), .step = 0.1});
      },
      {"'gauge'", "the velocity along 'z'"});
}

}  // namespace
}  // namespace diracstep
