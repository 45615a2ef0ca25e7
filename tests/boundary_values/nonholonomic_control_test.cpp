#include <cmath>

#include "controlled.hpp"

/// Optimal control under nonholonomic rows, where a motion without controls cannot be asked for both places.
namespace diracstep {
namespace {

using namespace testing;

/// A blade with the forces: a push along it and a turning moment.
ControlledScene knife_edge() {
  Scene scene;
  scene.name = "knife edge";
  scene.coordinates = {"x", "y", "h"};
  scene.lagrangian = lagrangian<3>(
      [](const auto&, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); });
  scene.constraints = {pfaffian<3, 1>([]<class T>(const std::array<T, 3>& q) {
    using std::cos, std::sin;
    return std::array<std::array<T, 3>, 1>{{{sin(q[2]), -cos(q[2]), T(0.0)}}};
  })};
  scene.start = {0.0, Vector::Zero(3), Vector::Zero(3)};
  ControlledScene controlled;
  controlled.scene = std::make_shared<const Scene>(scene);
  controlled.controls = {"push", "turn"};
  controlled.force = force<5>([]<class T>(const std::array<T, 5>& q, const std::array<T, 5>&) {
    using std::cos, std::sin;
    return std::array<T, 5>{q[3] * cos(q[2]), q[3] * sin(q[2]), q[4], T(0.0), T(0.0)};
  });
  controlled.cost =
      lagrangian<5>([](const auto& q, const auto&) { return 0.5 * (q[3] * q[3] + q[4] * q[4]); });
  return controlled;
}

/// From rest to rest, one length sideways, where both places could not be asked of a motion without controls.
/// The cost is that of the reduced system's states and costates: speed s, x' = s cos h, s' = push, h'' =
/// turn.
TEST(Transcription, AKnifeEdgeIsParkedSideways) {
  NEEDS_IPOPT();
  const double time = 4.0;
  const EndValues at_rest_start{{0, 0.0}, {1, 0.0}, {2, 0.0}, {3, 0.0}, {4, 0.0}, {5, 0.0}};
  const EndValues at_rest_end{{0, 1.0}, {1, 1.0}, {2, 0.0}, {3, 0.0}, {4, 0.0}, {5, 0.0}};
  constexpr long count = 24;
  ControlProblem problem =
      problem_of(knife_edge(), {.method = "type1/gl:2", .step = time / count}, count,
                 conditions_on(3, at_rest_start, at_rest_end), Vector::Zero(3), Vector{{1.0, 1.0, 0.0}});
  problem.degree = 1;
  const OptimalControlReport report = solve_optimal_control(problem);
  ASSERT_TRUE(report.converged) << report.ending;
  EXPECT_LT(report.end_of_run, 1e-8);
  EXPECT_LT(distance(report.q.rightCols(1), Vector{{1.0, 1.0, 0.0}}), 1e-9);
  EXPECT_LT(distance(report.v.rightCols(1), Vector::Zero(3)), 1e-9);
  for (Eigen::Index k = 0; k <= count; ++k)
    EXPECT_NEAR(report.v(0, k) * std::sin(report.q(2, k)) - report.v(1, k) * std::cos(report.q(2, k)), 0.0,
                1e-10);
  Scene scene;
  scene.name = "costates";
  scene.coordinates = {"x", "y", "h", "s", "w", "a", "b", "c", "d", "e"};
  scene.lagrangian = lagrangian<10>([](const auto& q, const auto& v) {
    using std::cos, std::sin;
    return q[5] * (v[0] - q[3] * cos(q[2])) + q[6] * (v[1] - q[3] * sin(q[2])) + q[7] * (v[2] - q[4]) +
           q[8] * v[3] + q[9] * v[4] - 0.5 * (q[8] * q[8] + q[9] * q[9]);
  });
  scene.start = {0.0, Vector::Zero(10), Vector::Zero(10)};
  const BoundaryReport exact = solve_boundary_values(
      {std::make_shared<const Scene>(scene),
       Registry::with_built_ins(),
       kinsol(),
       {.method = "type1/gl:3", .step = time / 48},
       48,
       conditions_on(10, {{0, 0.0}, {1, 0.0}, {2, 0.0}, {3, 0.0}, {4, 0.0}},
                     {{0, 1.0}, {1, 1.0}, {2, 0.0}, {3, 0.0}, {4, 0.0}}),
       [&](double t) {
         const Eigen::Index k = std::min<Eigen::Index>(std::lround(t / time * count), count);
         const Eigen::Index of_step = std::min<Eigen::Index>(2 * k, 2 * count - 1);
         const double h = report.q(2, k);
         Vector q = Vector::Zero(10);
         q << report.q.col(k), report.v(0, k) * std::cos(h) + report.v(1, k) * std::sin(h), report.v(2, k),
             0.0, 0.0, 0.0, report.controls(0, of_step), report.controls(1, of_step);
         return GuessedPoint{q, Vector::Zero(10)};
       }});
  ASSERT_TRUE(exact.converged) << exact.ending;
  double cost = 0.0;  // Simpson's rule
  for (long k = 0; k <= 48; ++k)
    cost += (k == 0 || k == 48 ? 1.0 : k % 2 == 1 ? 4.0 : 2.0) * 0.5 * exact.q.col(k).tail(2).squaredNorm();
  cost *= time / 48 / 3.0;
  EXPECT_NEAR(report.cost, cost, 1e-4 * cost);
}

/// Ostrowski's snakeboard with wheels that turn against each other and a rotor: x, y, heading, rotor, wheels;
/// torques on the rotor and on the wheels, which are all that moves it.
ControlledScene snakeboard() {
  Scene scene;
  scene.name = "snakeboard";
  scene.coordinates = {"x", "y", "heading", "rotor", "wheels"};
  scene.lagrangian = lagrangian<5>([](const auto&, const auto& v) {
    const double mass = 1.0, length = 0.5, rotor = 0.1, wheels = 0.05;
    return 0.5 * mass * (v[0] * v[0] + v[1] * v[1] + length * length * v[2] * v[2]) + rotor * v[2] * v[3] +
           0.5 * rotor * v[3] * v[3] + wheels * v[4] * v[4];
  });
  scene.constraints = {pfaffian<5, 2>([]<class T>(const std::array<T, 5>& q) {
    using std::cos, std::sin;
    const double length = 0.5;
    const T zero(0.0);
    return std::array<std::array<T, 5>, 2>{
        {{-sin(q[2] + q[4]), cos(q[2] + q[4]), -length * cos(q[4]), zero, zero},
         {-sin(q[2] - q[4]), cos(q[2] - q[4]), length * cos(q[4]), zero, zero}}};
  })};
  scene.start = {0.0, Vector::Zero(5), Vector::Zero(5)};
  ControlledScene controlled;
  controlled.scene = std::make_shared<const Scene>(scene);
  controlled.controls = {"rotor torque", "wheel torque"};
  controlled.force = force<7>([]<class T>(const std::array<T, 7>& q, const std::array<T, 7>&) {
    const T zero(0.0);
    return std::array<T, 7>{zero, zero, zero, q[5], q[6], zero, zero};
  });
  controlled.cost =
      lagrangian<7>([](const auto& q, const auto&) { return 0.5 * (q[5] * q[5] + q[6] * q[6]); });
  return controlled;
}

/// From rest to rest half a length ahead, in nine units of time; no force acts that way.
TEST(Transcription, ASnakeboardMovesByItsRotorAndWheels) {
  NEEDS_IPOPT();
  const double time = 9.0;
  EndValues start, end;
  for (int i = 0; i < 10; ++i) start.emplace_back(i, 0.0);
  for (const int i : {0, 1, 2, 4, 5, 6, 7, 8, 9})
    end.emplace_back(i, i == 0 ? 0.5 : 0.0);  // the rotor is free
  const auto solved_with = [&](long count) {
    ControlProblem problem =
        problem_of(snakeboard(), {.method = "type1/gl:2", .step = time / static_cast<double>(count)}, count,
                   conditions_on(5, start, end), Vector::Zero(5), Vector::Zero(5));
    problem.guess = [=](double t) {
      const double s = 2.0 * M_PI * t / time;
      return GuessedPoint{
          Vector{{0.5 * t / time, 0.0, 0.2 * std::sin(s), 2.0 * std::sin(s), 0.5 * std::sin(s)}},
          Vector::Zero(5)};
    };
    return solve_optimal_control(problem);
  };
  const OptimalControlReport report = solved_with(18);
  ASSERT_TRUE(report.converged) << report.ending;
  EXPECT_LT(report.end_of_run, 1e-6);
  EXPECT_NEAR(report.q(0, 18), 0.5, 1e-9);
  EXPECT_LT(report.v.rightCols(1).lpNorm<Eigen::Infinity>(), 1e-8);
  EXPECT_GT(report.controls.cwiseAbs().maxCoeff(), 1e-3);
  for (Eigen::Index k = 0; k <= 18; ++k) {
    const Vector q = report.q.col(k), v = report.v.col(k);
    for (const double side : {1.0, -1.0})
      EXPECT_NEAR(-std::sin(q[2] + side * q[4]) * v[0] + std::cos(q[2] + side * q[4]) * v[1] -
                      side * 0.5 * std::cos(q[4]) * v[2],
                  0.0, 1e-9);
  }
}

}  // namespace
}  // namespace diracstep
