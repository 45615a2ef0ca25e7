#include <Eigen/LU>
#include <cmath>
#include <diracstep/boundary_values/boundary_values.hpp>
#include <unsupported/Eigen/MatrixFunctions>

#include "combinations.hpp"
#include "controlled.hpp"

/// Optimal control by Pontryagin's principle: states and costates are the coordinates of a Lagrangian linear
/// in v, λ·ẋ − H(x, λ), whose motions between given states are the optimal ones.
namespace diracstep {
namespace {

using namespace testing;

BoundaryReport controlled(const ScenePointer& scene, const IntegratorOptions& options, long count,
                          const EndValues& start, const EndValues& end, const GuessedMotion& guess) {
  const int n = scene->dimension();
  return solve_boundary_values(
      {scene, Registry::with_built_ins(), kinsol(), options, count, conditions_on(n, start, end), guess});
}

GuessedMotion resting_at(const Vector& q) {
  return [q](double) { return GuessedPoint{q, Vector::Zero(q.size())}; };
}

/// x'' = −x + b with the least ∫ (x² + x'² + b²)/2 and a free end: the costates are those of the Riccati
/// equation, by the exponential of Hamilton's matrix.
TEST(OptimalControl, TheLinearQuadraticCaseIsThatOfTheRiccatiEquation) {
  Scene scene;
  scene.name = "linear-quadratic";
  scene.coordinates = {"x", "u", "a", "b"};
  scene.lagrangian = lagrangian<4>([](const auto& q, const auto& v) {
    return q[2] * (v[0] - q[1]) + q[3] * (v[1] + q[0]) + 0.5 * (q[0] * q[0] + q[1] * q[1] - q[3] * q[3]);
  });
  scene.start = {0.0, Vector{{1.0, 0.5, 0.0, 0.0}}, Vector::Zero(4)};
  const auto shared = std::make_shared<const Scene>(scene);
  const double time = 3.0;
  const Columns h{{0.0, 1.0, 0.0, 0.0}, {-1.0, 0.0, 0.0, 1.0}, {1.0, 0.0, 0.0, 1.0}, {0.0, 1.0, -1.0, 0.0}};
  const Columns flow = (time * h).exp();
  const Vector costates =
      -flow.bottomRightCorner(2, 2).inverse() * flow.bottomLeftCorner(2, 2) * Vector{{1.0, 0.5}};
  const auto error = [&](const char* method, long count) {
    const BoundaryReport report =
        controlled(shared, {.method = method, .step = time / static_cast<double>(count)}, count,
                   {{0, 1.0}, {1, 0.5}}, {{2, 0.0}, {3, 0.0}}, resting_at(scene.start.q));
    EXPECT_TRUE(report.converged) << report.ending;
    return (report.q.col(0).tail(2) - costates).norm();
  };
  EXPECT_LT(error("type1/gl:6", 30), 1e-12);
  EXPECT_NEAR(std::log2(error("type1/gl:2", 20) / error("type1/gl:2", 40)), 4.0, 0.2);
}

/// A car with speed a cos h + b sin h and turning rate c, the costates' forms, parks one length sideways in
/// unit time with the least ∫ (speed² + rate²)/2.  Twice its heading is a pendulum that swings once: its
/// period 4K(c/b)/b is 1.
TEST(OptimalControl, ACarParksSideways) {
  Scene scene;
  scene.name = "car";
  scene.coordinates = {"x", "y", "h", "a", "b", "c"};
  scene.lagrangian = lagrangian<6>([](const auto& q, const auto& v) {
    using std::cos, std::sin;
    const auto speed = q[3] * cos(q[2]) + q[4] * sin(q[2]);
    return q[3] * v[0] + q[4] * v[1] + q[5] * v[2] - 0.5 * speed * speed - 0.5 * q[5] * q[5];
  });
  scene.start = {0.0, Vector{{0.0, 0.0, 0.0, 0.1, 1.0, 1.0}}, Vector::Zero(6)};
  const auto shared = std::make_shared<const Scene>(scene);
  const IntegratorOptions options{.method = "type1/gl:4", .step = 0.02};
  const auto from_start = [&] {
    std::vector<Vector> path;
    Integrator integrator = integrator_for(shared, options);
    for (long k = 0; k <= 50; ++k) {
      path.push_back(integrator.position());
      EXPECT_TRUE(integrator.step().ok());
    }
    return path;
  }();
  const BoundaryReport report = controlled(
      shared, options, 50, {{0, 0.0}, {1, 0.0}, {2, 0.0}}, {{0, 0.0}, {1, 1.0}, {2, 0.0}}, [&](double t) {
        return GuessedPoint{from_start[static_cast<std::size_t>(std::lround(t / 0.02))], Vector::Zero(6)};
      });
  ASSERT_TRUE(report.converged) << report.ending;
  const double b = std::abs(report.q(4, 0)), c = std::abs(report.q(5, 0));
  EXPECT_NEAR(report.q(3, 0), 0.0, 1e-12);
  EXPECT_NEAR(4.0 * std::comp_ellint_1(c / b), b, 1e-9);
}

/// Low thrust from a circular orbit to a larger one, in seven units of time.  By the principle of the
/// envelope the cost ∫ |thrust|²/2 changes with the start by less the costate there.
TEST(OptimalControl, ALowThrustTransfer) {
  Scene scene;
  scene.name = "transfer";
  scene.coordinates = {"x", "y", "u", "w", "l", "m", "thrust x", "thrust y"};
  scene.lagrangian = lagrangian<8>([](const auto& q, const auto& v) {
    using std::sqrt;
    const auto r2 = q[0] * q[0] + q[1] * q[1];
    const auto attraction = 1.0 / (r2 * sqrt(r2));
    return q[4] * (v[0] - q[2]) + q[5] * (v[1] - q[3]) + q[6] * (v[2] + attraction * q[0]) +
           q[7] * (v[3] + attraction * q[1]) - 0.5 * (q[6] * q[6] + q[7] * q[7]);
  });
  scene.start = {0.0, Vector{{1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0}}, Vector::Zero(8)};
  const auto shared = std::make_shared<const Scene>(scene);
  constexpr long count = 140;
  const IntegratorOptions options{.method = "type1/gl:3", .step = 7.0 / count};
  const double far = 1.2;
  Vector costates;
  const auto cost = [&](double x0, double w0) {
    const BoundaryReport report =
        controlled(shared, options, count, {{0, x0}, {1, 0.0}, {2, 0.0}, {3, w0}},
                   {{0, far}, {1, 0.0}, {2, 0.0}, {3, 1.0 / std::sqrt(far)}}, [](double t) {
                     Vector q = Vector::Zero(8);
                     q.head(4) << std::cos(t), std::sin(t), -std::sin(t), std::cos(t);
                     return GuessedPoint{q, Vector::Zero(8)};
                   });
    EXPECT_TRUE(report.converged) << report.ending;
    costates = report.q.col(0).tail(4);
    double sum = 0.0;  // Simpson's rule
    for (long k = 0; k <= count; ++k)
      sum += (k == 0 || k == count ? 1.0 : k % 2 == 1 ? 4.0 : 2.0) * report.q.col(k).tail(2).squaredNorm();
    return 0.5 * sum * options.step / 3.0;
  };
  const double s = 1e-3;
  const double by_x = (cost(1.0 + s, 1.0) - cost(1.0 - s, 1.0)) / (2.0 * s);
  const double by_w = (cost(1.0, 1.0 + s) - cost(1.0, 1.0 - s)) / (2.0 * s);
  EXPECT_LT(cost(1.0, 1.0), 1e-3);
  EXPECT_NEAR(by_x, -costates[0], 1e-5);
  EXPECT_NEAR(by_w, -costates[3], 1e-5);
}

}  // namespace
}  // namespace diracstep
