#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/constraints/holonomic.hpp>

#include "extrapolation.hpp"
#include "methods.hpp"
#include "misuse.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::expect_misuse;
using testing::samples_of;

struct Links {
  /// What two links of length 1 make zero, of q = (x1, y1, x2, y2, …).
  template <class Q>
  static auto apart(const Q& q) {
    const auto first = q[0] * q[0] + q[1] * q[1] - 1.0;
    const auto dx = q[2] - q[0], dy = q[3] - q[1];
    return std::array{first, dx * dx + dy * dy - 1.0};
  }
  template <class Q, class V>
  static auto free(const Q& q, const V& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) + (v[2] * v[2] + v[3] * v[3]) - q[1] - 2.0 * q[3];
  }
};

/// A double pendulum with its two multipliers, a and b, as coordinates: L = L0 − a φ1 − 3 b φ2.
std::shared_ptr<const Scene> with_multipliers() {
  auto scene = std::make_shared<Scene>();
  scene->name = "multipliers";
  scene->coordinates = {"x1", "y1", "x2", "y2", "a", "b"};
  scene->lagrangian = lagrangian<6>([](const auto& q, const auto& v) {
    const auto phi = Links::apart(q);
    return Links::free(q, v) - q[4] * phi[0] - 3.0 * q[5] * phi[1];
  });
  // Other multipliers at the start would act at the nodes of L, and not of rows: a difference of the order.
  scene->start = {0.0, Vector{{1.0, 0.0, 1.0, 1.0, 0.0, 0.0}}, Vector{{0.0, 0.3, 0.5, 0.3, 0.0, 0.0}}, {}};
  return scene;
}

std::shared_ptr<const Scene> with_rows() {
  auto scene = std::make_shared<Scene>();
  scene->name = "rows";
  scene->coordinates = {"x1", "y1", "x2", "y2"};
  scene->lagrangian = lagrangian<4>([](const auto& q, const auto& v) { return Links::free(q, v); });
  scene->constraints = {
      holonomic<4, 2>([]<class T>(const std::array<T, 4>& q) { return std::array<T, 2>(Links::apart(q)); })};
  scene->start = {0.0, Vector{{1.0, 0.0, 1.0, 1.0}}, Vector{{0.0, 0.3, 0.5, 0.3}}, {}};
  return scene;
}

/// The motion of the scene whose author writes rows, with the forces of these as the last coordinates, for
/// methods of every kind; so the orders are those of holonomic rows.
TEST(MultipliersAsCoordinates, AreTheForcesOfTheRowsTheyStandFor) {
  const std::vector<IntegratorOptions> all{{.method = "type1/gl:1", .step = 0.02},
                                           {.method = "type1/gl:3", .step = 0.05},
                                           {.method = "type1/midpoint", .order = 4, .step = 0.02},
                                           {.method = "type1/trapezoidal", .step = 0.02},
                                           {.method = "damped/radau:2", .step = 0.02}};
  for (const IntegratorOptions& options : all) {
    const auto mine = samples_of(with_multipliers(), options, 60),
               rows = samples_of(with_rows(), options, 60);
    for (std::size_t k = 0; k < mine.size(); ++k) {
      ASSERT_LT((mine[k].q.head(4) - rows[k].q).lpNorm<Eigen::Infinity>(), 1e-11)
          << options.method << " " << k;
      ASSERT_LT((mine[k].v.head(4) - rows[k].v).lpNorm<Eigen::Infinity>(), 1e-10)
          << options.method << " " << k;
      ASSERT_NEAR(mine[k].q[4], -rows[k].lambda[0], 1e-9) << options.method << " " << k;
      ASSERT_NEAR(mine[k].q[5], -rows[k].lambda[1] / 3.0, 1e-9) << options.method << " " << k;
    }
  }
}

/// A scene whose last coordinate is a multiplier, and all of q at t = 1 by the reference.
struct MultiplierCase {
  std::shared_ptr<const Scene> scene;
  Vector q;
};

/// L = |v|²/2 − y − a (x² + y² − 1); reduced to the angle of (x, y) = (sin θ, −cos θ).
MultiplierCase pendulum_with_tension() {
  auto scene = std::make_shared<Scene>();
  scene->name = "pendulum with its tension";
  scene->coordinates = {"x", "y", "a"};
  scene->lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) - q[1] - q[2] * (q[0] * q[0] + q[1] * q[1] - 1.0);
  });
  scene->start = {0.0, Vector{{1.0, 0.0, 0.0}}, Vector{{0.0, 0.6, 0.0}}, {}};
  using testing::LongReal, testing::LongVector;
  const LongVector end = testing::extrapolated(
      [](LongReal, const LongVector& y) {
        return LongVector{{y[1], -std::sin(y[0])}};
      },
      LongVector{{std::acos(-1.0L) / 2, LongReal(0.6)}}, 1.0L);
  const LongReal down = std::cos(end[0]);
  return {scene, LongVector{{std::sin(end[0]), -down, (end[1] * end[1] + down) / 2}}.cast<double>()};
}

/// L = |v|²/2 − z − a (z − x²/2 − 3y²/4); reduced to (x, y).
MultiplierCase bowl_with_pressure() {
  auto scene = std::make_shared<Scene>();
  scene->name = "bowl with its pressure";
  scene->coordinates = {"x", "y", "z", "a"};
  scene->lagrangian = lagrangian<4>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) - q[2] -
           q[3] * (q[2] - 0.5 * q[0] * q[0] - 0.75 * q[1] * q[1]);
  });
  scene->start = {0.0, Vector{{1.0, 0.5, 0.6875, 0.0}}, Vector{{0.25, 0.5, 0.625, 0.0}}, {}};
  using testing::LongReal, testing::LongVector;
  struct Rate {
    LongReal ax, ay, az;
  };
  const auto rate = [](const LongVector& y) {  // y = (x, y, v_x, v_y)
    const LongReal gx = y[0], gy = 1.5L * y[1], bent = y[2] * y[2] + 1.5L * y[3] * y[3],
                   pull = -(1 + bent) / (1 + gx * gx + gy * gy);
    return Rate{pull * gx, pull * gy, pull * (gx * gx + gy * gy) + bent};
  };
  const LongVector end = testing::extrapolated(
      [rate](LongReal, const LongVector& y) {
        const Rate at = rate(y);
        return LongVector{{y[2], y[3], at.ax, at.ay}};
      },
      LongVector{{1.0L, 0.5L, 0.25L, 0.5L}}, 1.0L);
  return {scene,
          LongVector{{end[0], end[1], 0.5L * end[0] * end[0] + 0.75L * end[1] * end[1], -1 - rate(end).az}}
              .cast<double>()};
}

TEST(MultipliersAsCoordinates, HaveTheOrderTwiceTheStagesLikeThePositions) {
  for (const MultiplierCase& that : {pendulum_with_tension(), bowl_with_pressure()}) {
    const auto error = [&](int s, long steps) {
      const Sample end =
          samples_of(that.scene, {.method = testing::gl(s), .step = 1.0 / static_cast<double>(steps)}, steps,
                     Momentum::projected, Registry::with_built_ins(), steps)
              .back();
      return (end.q - that.q).lpNorm<Eigen::Infinity>();
    };
    for (const auto& [s, steps] : {std::pair{1, 40L}, {2, 10L}, {3, 5L}}) {
      const double first = error(s, steps), second = error(s, 2 * steps);
      EXPECT_GT(second, 3e-13) << that.scene->name << ": at round-off, nothing is measured";
      EXPECT_NEAR(std::log2(first / second), 2.0 * s, 0.4)
          << that.scene->name << " s = " << s << " errors " << first << " " << second;
    }
  }
}

TEST(MultipliersAsCoordinates, BesideARowThatSaysTheSameAreRefused) {
  auto scene = std::make_shared<Scene>(*with_multipliers());
  scene->constraints = {holonomic<6, 1>(
      []<class T>(const std::array<T, 6>& q) { return std::array<T, 1>{2.0 * Links::apart(q)[1]}; },
      {"link"})};
  expect_misuse([&] { (void)samples_of(scene, {.method = "type1/gl:2", .step = 0.1}, 1); },
                {"'multipliers'", "row 'link'", "leave out the one or the other"});
}

TEST(MultipliersAsCoordinates, OfWhatMovesWithTheTimeAreRefused) {
  auto scene = std::make_shared<Scene>(*with_multipliers());
  scene->lagrangian = lagrangian<6>([](const auto& q, const auto& v, const auto& t) {
    const auto phi = Links::apart(q);
    return Links::free(q, v) - q[4] * (phi[0] - t) - q[5] * phi[1];
  });
  expect_misuse([&] { Integrator(scene, Registry::with_built_ins(), kinsol(), {.step = 0.1}); },
                {"'multipliers'", "a", "depends on the time", "state that as a row"});
}

TEST(MultipliersAsCoordinates, OfTheSameFunctionAreNamed) {
  auto scene = std::make_shared<Scene>(*with_multipliers());
  scene->lagrangian = lagrangian<6>([](const auto& q, const auto& v) {
    const auto phi = Links::apart(q);
    return Links::free(q, v) - (q[4] + q[5]) * phi[0];
  });
  expect_misuse([&] { Integrator(scene, Registry::with_built_ins(), kinsol(), {.step = 0.1}); },
                {"'a', 'b'", "multipliers of the same", "leave out all but 1"});
}

}  // namespace
}  // namespace diracstep
