#include <gtest/gtest.h>

#include <diracstep/core/system/saddle_point.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "differences.hpp"
#include "rows.hpp"
#include "scenes.hpp"

namespace diracstep {
namespace {

/// Solves with KINSOL from zero.
Vector solution_of(NonlinearProblem& problem) {
  Vector x = Vector::Zero(problem.size());
  EXPECT_TRUE(kinsol()(problem)->solve(x).ok());
  return x;
}

/// A particle under gravity 9.81 in the plane.
Scene planar(ConstraintBlocks constraints) {
  Scene scene;
  scene.coordinates = {"x", "y"};
  scene.lagrangian = lagrangian<2>(
      [](const auto& q, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]) - 9.81 * q[1]; });
  scene.constraints = std::move(constraints);
  return scene;
}

Scene pendulum() {
  return planar({holonomic<2, 1>(
      []<class T>(const std::array<T, 2>& q) { return std::array<T, 1>{q[0] * q[0] + q[1] * q[1] - 1.0}; })});
}

class SaddlePoint : public ::testing::TestWithParam<bool> {};

TEST_P(SaddlePoint, PendulumVelocityIsTheTangentialPartOfTheMomentum) {
  const Scene scene = pendulum();
  VelocityProblem problem(scene, GetParam());
  problem.begin(0.0, Vector{{0.6, -0.8}}, Vector{{3.0, 1.0}}, Vector::Zero(2));
  // p = v − 2μ q with v ⊥ q: p·q = 1, so μ = −1/2 and v = p − q.
  EXPECT_LT((solution_of(problem) - Vector{{2.4, 1.8, -0.5}}).lpNorm<Eigen::Infinity>(), 1e-14);
}

TEST_P(SaddlePoint, PendulumAccelerationAndRodForce) {
  const Scene scene = pendulum();
  AccelerationProblem problem(scene, GetParam());
  const double rate = 2.5, force = (9.81 * -0.8 - rate * rate) / 2.0;  // q·a = −rate²
  problem.begin(0.0, Vector{{0.6, -0.8}}, rate * Vector{{0.8, 0.6}});
  const Vector expected{{2.0 * force * 0.6, -9.81 - 2.0 * force * 0.8, force}};
  EXPECT_LT((solution_of(problem) - expected).lpNorm<Eigen::Infinity>(), 1e-13);
}

TEST_P(SaddlePoint, BeadOnATurningLineFeelsCoriolisForce) {
  // φ = −x sin ωt + y cos ωt; without gravity along it, Λ = 2 ω dr/dt + g cos ωt and r'' = ω² r − g sin ωt.
  const double w = 1.7, t = 0.4, r = 1.3, rate = 0.9;
  const Scene scene = planar({holonomic<2, 1>([w]<class T>(const std::array<T, 2>& q, const T& time) {
    using std::cos, std::sin;
    return std::array<T, 1>{q[1] * cos(w * time) - q[0] * sin(w * time)};
  })});
  const Vector along{{std::cos(w * t), std::sin(w * t)}}, across{{-std::sin(w * t), std::cos(w * t)}};
  const double force = 2.0 * w * rate + 9.81 * across[1];
  AccelerationProblem problem(scene, GetParam());
  problem.begin(t, r * along, rate * along + r * w * across);
  const Vector x = solution_of(problem);
  EXPECT_NEAR(x[2], force, 1e-13);
  EXPECT_LT((x.head(2) - Vector{{0.0, -9.81}} - force * across).norm(), 1e-13);
  VelocityProblem velocity(scene, GetParam());
  velocity.begin(t, r * along, rate * along - 5.0 * across, Vector::Zero(2));
  EXPECT_LT((solution_of(velocity).head(2) - rate * along - r * w * across).norm(), 1e-13);
}

TEST_P(SaddlePoint, GrowingMassSlowsDown) {
  // L = e^{2t} (v² − q²) / 2:  a = −2 v − q.
  Scene scene;
  scene.coordinates = {"x"};
  scene.lagrangian = lagrangian<1>([](const auto& q, const auto& v, const auto& t) {
    using std::exp;
    return exp(2.0 * t) * (0.5 * v[0] * v[0] - 0.5 * q[0] * q[0]);
  });
  AccelerationProblem problem(scene, GetParam());
  problem.begin(0.3, Vector::Constant(1, 0.7), Vector::Constant(1, -1.1));
  EXPECT_NEAR(solution_of(problem)[0], 2.2 - 0.7, 1e-14);
}

/// Position-dependent mass and a term linear in v, both changing with the time.
struct DrivenTwist {
  template <class T>
  T operator()(const std::array<T, 3>& q, const std::array<T, 3>& v, const T& t) const {
    using std::sin;
    return testing::Particle{}(q, v) + (1.0 + t) * q[0] * v[1] * v[1] + sin(t * q[2]) * v[0] -
           t * q[1] * q[1];
  }
};

Scene driven(std::shared_ptr<const ConstraintRows> rows) {
  Scene scene = testing::particle("driven");
  scene.lagrangian = lagrangian<3>(DrivenTwist{});
  scene.constraints = {std::move(rows)};
  return scene;
}

TEST_P(SaddlePoint, AccelerationSatisfiesTheEquationsOfMotionByDifferences) {
  const double t = 0.7;
  const Vector q{{0.4, -0.9, 1.3}}, v{{0.8, 0.5, -0.6}};
  for (const auto& rows : {testing::moving_affine(), testing::moving_holonomic()}) {
    const Scene scene = driven(rows);
    AccelerationProblem problem(scene, GetParam());
    problem.begin(t, q, v);
    const Vector x = solution_of(problem), a = x.head(3), force = x.tail(2);
    // Along the curve with this acceleration: ∂L/∂q, then ∂L/∂v and A v + b, whose rates are taken.
    Vector lq(3), lv(3);
    const auto moving = [&](const Vector& s) {
      const Vector at = q + s[0] * v + 0.5 * s[0] * s[0] * a, speed = v + s[0] * a;
      scene.lagrangian->gradient(t + s[0], at, speed, lq, lv);
      const testing::RowsAt point(*rows, t + s[0], at);
      Vector both(5);
      both << lv, testing::full(rows->pattern(), point.values) * speed + point.b;
      return both;
    };
    const Vector rates = testing::difference_jacobian(moving, Vector::Zero(1));
    scene.lagrangian->gradient(t, q, v, lq, lv);
    const testing::RowsAt point(*rows, t, q);
    const Vector balance =
        rates.head(3) - lq - testing::full(rows->pattern(), point.values).transpose() * force;
    EXPECT_LT(balance.lpNorm<Eigen::Infinity>(), 1e-8);
    EXPECT_LT(rates.tail(2).lpNorm<Eigen::Infinity>(), 1e-8);
  }
}

TEST_P(SaddlePoint, JacobiansAgreeWithDifferences) {
  const Vector q{{0.4, -0.9, 1.3}}, v{{0.8, 0.5, -0.6}}, x{{0.3, -0.2, 0.5, 1.1, -0.7}};
  for (const auto& rows : {testing::moving_affine(), testing::moving_holonomic()}) {
    const Scene scene = driven(rows);
    VelocityProblem velocity(scene, GetParam());
    velocity.begin(0.7, q, v, v);
    EXPECT_LT(testing::jacobian_error(velocity, x), 1e-8);
    AccelerationProblem acceleration(scene, GetParam());
    acceleration.begin(0.7, q, v);
    EXPECT_LT(testing::jacobian_error(acceleration, x), 1e-8);
  }
}

TEST_P(SaddlePoint, ProjectionLeavesAMomentumOfTheDistributionAsItIs) {
  for (const auto& scene : testing::every_constraint_class()) {
    const Start& start = scene->start;
    Vector lq(3), p(3);
    scene->lagrangian->gradient(0.0, start.q, start.v, lq, p);
    VelocityProblem problem(*scene, GetParam());
    problem.begin(0.0, start.q, p, start.v);
    const Vector x = solution_of(problem);
    EXPECT_LT((x.head(3) - start.v).lpNorm<Eigen::Infinity>(), 1e-14) << scene->name;
    EXPECT_TRUE(x.tail(scene->rows()).isZero(1e-14)) << scene->name;
  }
}

INSTANTIATE_TEST_SUITE_P(Matrices, SaddlePoint, ::testing::Bool(),
                         [](const auto& test) { return test.param ? "Full" : "Sparse"; });

}  // namespace
}  // namespace diracstep
