#include <algorithm>
#include <cmath>

#include "solved.hpp"

namespace diracstep {
namespace {

using namespace testing;

ScenePointer three_bodies() {
  Scene scene;
  scene.name = "three bodies";
  scene.coordinates = {"x1", "y1", "x2", "y2", "x3", "y3"};
  scene.lagrangian = lagrangian<6>([](const auto& q, const auto& v) {
    using std::sqrt;
    auto l = 0.5 * v[0] * v[0];
    for (std::size_t i = 1; i < 6; ++i) l = l + 0.5 * v[i] * v[i];
    for (std::size_t i = 0; i < 6; i += 2)
      for (std::size_t j = i + 2; j < 6; j += 2) {
        const auto dx = q[i] - q[j], dy = q[i + 1] - q[j + 1];
        l = l + 1.0 / sqrt(dx * dx + dy * dy);
      }
    return l;
  });
  // Chenciner and Montgomery, Annals of Mathematics 152 (2000), with the numbers of C. Simó.
  const double x = 0.97000436, y = -0.24308753, u = -0.93240737, w = -0.86473146;
  scene.start = {0.0, Vector{{x, y, -x, -y, 0.0, 0.0}},
                 Vector{{-0.5 * u, -0.5 * w, -0.5 * u, -0.5 * w, u, w}}};
  return std::make_shared<const Scene>(scene);
}
constexpr double figure_eight_period = 6.32591398;

/// The guess of a run that began at t = 0.
GuessedMotion through(const std::vector<Sample>& run, double step) {
  return [&run, step](double t) {
    const Sample& at = run[static_cast<std::size_t>(std::lround(t / step))];
    return GuessedPoint{at.q, at.v};
  };
}

TEST(BoundaryValues, TheFigureEightIsPeriodicWithItsMultipliers) {
  const ScenePointer scene = three_bodies();
  constexpr long count = 120;
  const IntegratorOptions options{.method = "type1/gl:6", .step = figure_eight_period / count};
  // From a start some 1e-3 off.
  Scene off = *scene;
  for (int i = 0; i < 6; ++i) {
    off.start.q[i] += 1e-3 * std::sin(3.0 * i);
    off.start.v[i] += 1e-3 * std::cos(2.0 * i);
  }
  const auto guess = samples_of(std::make_shared<const Scene>(off), options, count);
  const BoundaryReport report = solved(scene, options, periodic(6), through(guess, options.step), count);
  ASSERT_TRUE(report.converged) << report.ending;
  EXPECT_LE(report.iterations, 12);
  EXPECT_LT(distance(report.q.col(0), report.q.rightCols(1)), 1e-11);
  EXPECT_LT(distance(report.v.col(0), report.v.rightCols(1)), 1e-11);
  expect_motion(scene, options, report, 1e-9);
  // Free are where it lies (2), how it is turned, and where on it the motion starts.
  EXPECT_EQ(report.free_directions, 4);
  // Of twelve multipliers eight are 1; the others e^±2πiν with ν of Simó (Celestial Mechanics, Contemporary
  // Mathematics 292, 2002): on the circle, the eight is stable.
  std::vector<double> turns;
  for (const auto& multiplier : report.multipliers) {
    EXPECT_NEAR(std::abs(multiplier), 1.0, 1e-3);  // 1 is defective: its square root of round-off
    if (std::arg(multiplier) > 1e-2) turns.push_back(std::arg(multiplier) / (2.0 * M_PI));
  }
  std::ranges::sort(turns);
  ASSERT_EQ(turns.size(), 2U);
  EXPECT_NEAR(turns[0], 0.00842272, 1e-7);
  EXPECT_NEAR(turns[1], 0.29809253, 1e-7);
}

TEST(BoundaryValues, PeriodicOrbitsOfALagrangianLinearInTheVelocity) {
  // Lotka-Volterra, linear in v: its motions are all periodic, with a period that says which.
  const ScenePointer scene = phase_space();
  const IntegratorOptions options{.method = "type1/gl:3", .step = 0.1};
  const auto guess = samples_of(scene, options, 52);  // its own period is about 4.95
  for (const long count : {48L, 50L, 52L}) {
    const BoundaryReport report = solved(scene, options, periodic(2), through(guess, options.step), count);
    ASSERT_TRUE(report.converged) << report.ending;
    EXPECT_EQ(report.free_directions, 1);
    EXPECT_GT((report.q.colwise() - report.q.col(0)).norm(), 1.0);  // no point at rest
    EXPECT_LT(distance(report.q.col(0), report.q.rightCols(1)), 1e-11);
  }
}

TEST(BoundaryValues, PeriodicOrbitsOnHolonomicRows) {
  // A pendulum in Cartesian coordinates: its period says how far it swings.
  Scene scene;
  scene.name = "pendulum";
  scene.coordinates = {"x", "y"};
  scene.lagrangian =
      lagrangian<2>([](const auto& q, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]) - q[1]; });
  scene.constraints = {holonomic<2, 1>(
      []<class T>(const std::array<T, 2>& q) { return std::array<T, 1>{q[0] * q[0] + q[1] * q[1] - 1.0}; })};
  scene.start = {0.0, Vector{{1.0, 0.0}}, Vector::Zero(2)};
  const auto pendulum = std::make_shared<const Scene>(scene);
  constexpr long count = 80;
  const IntegratorOptions options{.method = "type1/gl:5", .step = 7.0 / count};
  const auto guess = samples_of(pendulum, options, count);
  const BoundaryReport report = solved(pendulum, options, periodic(2), through(guess, options.step), count);
  ASSERT_TRUE(report.converged) << report.ending;
  EXPECT_EQ(report.free_directions, 1);
  ASSERT_EQ(report.multipliers.size(), 2U);  // both 1, defective
  for (const auto& multiplier : report.multipliers) EXPECT_NEAR(std::abs(multiplier - 1.0), 0.0, 1e-4);
  // The period of a swing to the angle a is 4 K(sin(a/2)).
  const double energy = 0.5 * report.v.col(0).squaredNorm() + report.q(1, 0);  // −cos a
  EXPECT_NEAR(4.0 * std::comp_ellint_1(std::sqrt(0.5 * (1.0 + energy))), 7.0, 1e-9);
}

ScenePointer harmonic() {
  Scene scene;
  scene.name = "harmonic";
  scene.coordinates = {"x"};
  scene.lagrangian =
      lagrangian<1>([](const auto& q, const auto& v) { return 0.5 * (v[0] * v[0] - q[0] * q[0]); });
  scene.start = {0.0, Vector::Ones(1), Vector::Zero(1)};
  return std::make_shared<const Scene>(scene);
}

/// All motions of an oscillator have one period: there both directions are free, though the conditions leave
/// nothing but round-off to judge that by.
TEST(BoundaryValues, WhereEveryMotionIsPeriodicAllDirectionsAreFree) {
  const IntegratorOptions options{.method = "type1/gl:4", .step = 2.0 * M_PI / 60};
  const auto guess = samples_of(harmonic(), options, 60);
  const BoundaryReport report = solved(harmonic(), options, periodic(1), through(guess, options.step), 60);
  ASSERT_TRUE(report.converged) << report.ending;
  EXPECT_EQ(report.free_directions, 2);
  EXPECT_GT(report.q.norm(), 1.0);
}

/// At other times the rest at zero is the only periodic motion, where nothing is left to measure corrections
/// by; also where other motions are all but periodic.
TEST(BoundaryValues, ARestAtZeroIsFound) {
  for (const double period : {2.0, 3.0, 6.28}) {
    SCOPED_TRACE(period);
    const IntegratorOptions options{.method = "type1/gl:4", .step = period / 60};
    const auto guess = samples_of(harmonic(), options, 60);
    const BoundaryReport report = solved(harmonic(), options, periodic(1), through(guess, options.step), 60);
    ASSERT_TRUE(report.converged) << report.ending;
    EXPECT_LT(report.q.norm(), 1e-9);
    EXPECT_EQ(report.free_directions, 0);
  }
}

/// A place of rest is periodic: numbers that are zero to round-off do not keep a search from ending.
TEST(BoundaryValues, ARestIsFoundAsWell) {
  const ScenePointer scene = phase_space();
  const BoundaryReport report = solved(scene, {.method = "type1/gl:3", .step = 0.1}, periodic(2), [](double) {
    return GuessedPoint{Vector{{1.01, 2.01}}, Vector::Zero(2)};
  });
  ASSERT_TRUE(report.converged) << report.ending;
  EXPECT_LT(distance(report.q.col(0), Vector{{1.0, 2.0}}), 1e-12);
  EXPECT_EQ(report.free_directions, 0);
}

}  // namespace
}  // namespace diracstep
