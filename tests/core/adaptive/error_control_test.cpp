#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/adaptive/error_control.hpp>

#include "misuse.hpp"
#include "scenes.hpp"
#include "stepping.hpp"

#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ < 13
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"  // of empty functions in options, which are made empty
#endif

namespace diracstep {
namespace {

using testing::expect_misuse;
using testing::samples_of;

ErrorControlReport solve(const std::shared_ptr<const Scene>& scene, double end,
                         const ErrorControlOptions& wanted) {
  return solve_to_error(scene, Registry::with_built_ins(), kinsol(), end, wanted);
}

double true_error(const std::shared_ptr<const Scene>& scene, const Sample& end, long steps) {
  const Sample reference =
      samples_of(scene, {.method = "type1/gl:6", .step = end.time / static_cast<double>(steps)}, steps)
          .back();
  return std::max((end.q - reference.q).lpNorm<Eigen::Infinity>() / reference.q.lpNorm<Eigen::Infinity>(),
                  (end.p - reference.p).lpNorm<Eigen::Infinity>() / reference.p.lpNorm<Eigen::Infinity>());
}

TEST(ErrorControl, DeliversTheErrorAskedForAndEstimatesIt) {
  for (const auto& scene : testing::every_constraint_class())
    for (const double error : {1e-3, 1e-5, 1e-7, 1e-9, 1e-11})
      for (const bool adaptive : {false, true}) {
        const ErrorControlReport report = solve(scene, 3.6, {.error = error, .adaptive = adaptive});
        ASSERT_TRUE(report.ok()) << scene->name << ": " << report.refusal;
        EXPECT_EQ(report.end.time, 3.6);
        const double reference = true_error(scene, report.end, 128);
        EXPECT_LT(reference, error) << scene->name << " adaptive " << adaptive;
        EXPECT_LT(report.estimate, error);
        if (reference > 1e-12) {
          EXPECT_LT(reference, 5.0 * report.estimate) << scene->name << " at " << error;
        }
        EXPECT_GE(report.runs.size(), 3u);
        EXPECT_GT(report.work.solves, 0);
      }
}

TEST(ErrorControl, TakesTheMethodAskedFor) {
  const auto scene = testing::holonomic_sphere();
  const ErrorControlReport report =
      solve(scene, 2.0, {.error = 1e-4, .method = "type1/midpoint", .adaptive = false});
  ASSERT_TRUE(report.ok()) << report.refusal;
  EXPECT_EQ(report.method, "type1/midpoint");
  EXPECT_EQ(report.order, 2);
  EXPECT_NEAR(report.observed_order, 2.0, 0.5);
  EXPECT_LT(true_error(scene, report.end, 64), 1e-4);
}

TEST(ErrorControl, RefusesAnErrorBelowRoundOffAndSaysWhy) {
  const ErrorControlReport report = solve(testing::nonholonomic(), 3.6, {.error = 1e-17, .adaptive = false});
  EXPECT_FALSE(report.ok());
  testing::expect_parts(report.refusal, {"1e-17", "round-off"});
  EXPECT_GT(report.end.q.size(), 0);
}

TEST(ErrorControl, RefusesWhereTheWorkIsUsedUp) {
  const ErrorControlReport report =
      solve(testing::nonholonomic(), 3.6,
            {.error = 1e-9, .method = "type1/midpoint", .adaptive = false, .max_solves = 2000});
  EXPECT_FALSE(report.ok());
  testing::expect_parts(report.refusal, {"1e-09", "nonlinear systems", "estimate"});
  EXPECT_LE(report.work.solves, 2000);
}

TEST(ErrorControl, FindsAFirstStepWhereCoarseOnesFail) {
  const auto scene = testing::holonomic_sphere();
  const ErrorControlReport report = solve(scene, 3.6, {.error = 1e-6, .adaptive = false, .first_step = 3.6});
  ASSERT_TRUE(report.ok()) << report.refusal;
  EXPECT_LT(true_error(scene, report.end, 128), 1e-6);
}

TEST(ErrorControl, RefusesMisuse) {
  expect_misuse([] { (void)solve(testing::mixed(), 1.0, {.error = 0.0}); }, {"error = 0", "between 0 and 1"});
  expect_misuse([] { (void)solve(testing::mixed(), 1.0, {.error = 1e-3, .method = "type1/none"}); },
                {"type1/none"});
  expect_misuse(
      [] { (void)solve(testing::mixed(), 1.0, {.error = 1e-3, .method = "type1/left", .adaptive = true}); },
      {"not self-adjoint"});
}

/// Of two oscillators one is 1500 times as fast; runs that do not resolve it show no order.
TEST(ErrorControl, AFastPhaseIsResolved) {
  constexpr double rate = 1478.1566076270233;
  auto scene = std::make_shared<Scene>();
  scene->name = "fast phase";
  scene->coordinates = {"x", "y"};
  scene->lagrangian = lagrangian<2>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1] - q[0] * q[0] - rate * rate * q[1] * q[1]);
  });
  scene->start = {0.0, Vector::Ones(2), Vector::Zero(2)};
  const ErrorControlReport report = solve(scene, 10.0, {.error = 1e-2});
  ASSERT_TRUE(report.ok()) << report.refusal;
  EXPECT_NEAR(report.end.q[0], std::cos(10.0), 1e-2);
  EXPECT_NEAR(report.end.q[1], std::cos(10.0 * rate), 1e-2);
  EXPECT_NEAR(report.end.p[1], -rate * std::sin(10.0 * rate), 1e-2 * rate);
}

/// A weight held up by a row that is written twice: the second one is left out, and has no force to look at.
TEST(ErrorControl, LooksAtTheRowsThatAreStepped) {
  auto scene = std::make_shared<Scene>();
  scene->name = "held weight";
  scene->coordinates = {"x", "y"};
  scene->lagrangian = lagrangian<2>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1] - q[0] * q[0]) - 9.81 * q[1];
  });
  scene->constraints = {pfaffian<2, 2>([]<class T>(const std::array<T, 2>&) {
    return std::array<std::array<T, 2>, 2>{{{T(0.0), T(1.0)}, {T(0.0), T(2.0)}}};
  })};
  scene->start = {0.0, Vector::Unit(2, 0), Vector::Zero(2)};
  const ErrorControlReport report = solve(scene, 3.0, {.error = 1e-6});
  ASSERT_TRUE(report.ok()) << report.refusal;
  EXPECT_EQ(report.end.lambda.size(), 1);
  EXPECT_NEAR(report.end.q[0], std::cos(3.0), 1e-6);
}

/// An ion in a trap, in SI units: momenta of 1e-28 count as those of 1 do.
TEST(ErrorControl, EstimatesHaveNoUnit) {
  const auto ion = [](double mass, double rate, double size) {
    auto scene = std::make_shared<Scene>();
    scene->name = "ion";
    scene->coordinates = {"x"};
    scene->lagrangian = lagrangian<1>(
        [=](const auto& q, const auto& v) { return 0.5 * mass * (v[0] * v[0] - rate * rate * q[0] * q[0]); });
    scene->start = {0.0, Vector::Constant(1, size), Vector::Zero(1)};
    return solve(scene, 3.0 / rate, {.error = 1e-6, .method = "type1/midpoint", .adaptive = false});
  };
  const ErrorControlReport unit = ion(1.0, 1.0, 1.0), si = ion(1.67262192e-27, 1e6, 1e-6);
  ASSERT_TRUE(unit.ok() && si.ok()) << unit.refusal << si.refusal;
  EXPECT_NEAR(si.estimate / unit.estimate, 1.0, 1e-3);
  EXPECT_EQ(si.runs.size(), unit.runs.size());
}

}  // namespace
}  // namespace diracstep
