#include <Eigen/LU>
#include <cmath>
#include <diracstep/boundary_values/optimal_control.hpp>
#include <limits>

#include "misuse.hpp"
#include "solved.hpp"

/// Optimal control with the steps as constraints.
namespace diracstep {
namespace {

using namespace testing;

constexpr double unbounded = std::numeric_limits<double>::infinity();

#define NEEDS_IPOPT() \
  if (!optimal_control_available()) GTEST_SKIP() << "not checked: built without Ipopt"

/// q or v of one end by number, of (q, v).
using Values = std::vector<std::pair<int, double>>;

BoundaryConditions conditions_on(int n, const Values& start, const Values& end) {
  const auto rows = static_cast<Eigen::Index>(start.size() + end.size());
  BoundaryConditions conditions{Columns::Zero(rows, 3L * n), Columns::Zero(rows, 3L * n), Vector(rows)};
  Eigen::Index row = 0;
  for (const auto& [i, value] : start) {
    conditions.at_start(row, i) = 1.0;
    conditions.value[row++] = value;
  }
  for (const auto& [i, value] : end) {
    conditions.at_end(row, i) = 1.0;
    conditions.value[row++] = value;
  }
  return conditions;
}

ControlProblem problem_of(const ControlledScene& controlled, const IntegratorOptions& options, long count,
                          const BoundaryConditions& conditions, const Vector& from, const Vector& to) {
  static const Registry registry = Registry::with_built_ins();
  const double t0 = controlled.scene->start.time;
  return {controlled,
          registry,
          kinsol(),
          options,
          count,
          conditions,
          straight_line(t0, from, t0 + static_cast<double>(count) * options.step, to)};
}

/// x'' = −x + u with ∫ (x² + v² + u²)/2 dt + x(T)².
ControlledScene oscillator(std::vector<double> bounds = {}) {
  Scene scene;
  scene.name = "oscillator";
  scene.coordinates = {"x"};
  scene.lagrangian =
      lagrangian<1>([](const auto& q, const auto& v) { return 0.5 * (v[0] * v[0] - q[0] * q[0]); });
  scene.start = {0.0, Vector{{1.0}}, Vector{{0.5}}};
  ControlledScene controlled;
  controlled.scene = std::make_shared<const Scene>(scene);
  controlled.controls = {"u"};
  controlled.force = force<2>([]<class T>(const std::array<T, 2>& q, const std::array<T, 2>&) {
    return std::array<T, 2>{q[1], T(0.0)};
  });
  controlled.cost = lagrangian<2>(
      [](const auto& q, const auto& v) { return 0.5 * (q[0] * q[0] + v[0] * v[0] + q[1] * q[1]); });
  controlled.end_cost = lagrangian<2>([](const auto& q, const auto&) { return q[0] * q[0]; });
  if (!bounds.empty()) {
    controlled.lower = Vector{{bounds[0]}};
    controlled.upper = Vector{{bounds[1]}};
  }
  return controlled;
}

/// The end (q, p) and the cost of one step from (q, p) with a constant control, by the integrator.
struct OneStep {
  Vector end;
  double cost;
};
OneStep one_step(double q, double p, double u, double h) {
  Scene scene;
  scene.name = "one step";
  scene.coordinates = {"x", "c"};
  scene.lagrangian = lagrangian<2>(
      [](const auto& x, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1] - x[0] * x[0]); });
  scene.force = force<2>([u]<class T>(const std::array<T, 2>& x, const std::array<T, 2>& v) {
    return std::array<T, 2>{T(u), 0.5 * (x[0] * x[0] + v[0] * v[0] + u * u)};
  });
  scene.start = {0.0, Vector{{q, 0.0}}, Vector{{p, 0.0}}};
  Integrator integrator =
      integrator_for(std::make_shared<const Scene>(scene), {.method = "type1/gl:2", .step = h});
  EXPECT_TRUE(integrator.step().ok());
  return {Vector{{integrator.position()[0], integrator.momentum()[0]}}, integrator.momentum()[1]};
}

TEST(Transcription, TheLinearQuadraticCaseIsTheRiccatiRecursionOfTheStep) {
  NEEDS_IPOPT();
  constexpr long count = 12;
  constexpr double h = 0.25;
  // z⁺ = A z + B u and the cost of a step in (z, u), read off steps: linear and quadratic.
  const auto basis = [](int i) { return Vector(Vector::Unit(3, i)); };
  const auto step = [&](const Vector& y) { return one_step(y[0], y[1], y[2], h); };
  Columns a(2, 2), b(2, 1), m(3, 3);
  for (int i = 0; i < 3; ++i) (i < 2 ? a.col(i) : b.col(0)) = step(basis(i)).end;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      m(i, j) = step(basis(i) + basis(j)).cost - step(basis(i)).cost - step(basis(j)).cost;
  Columns s{{2.0, 0.0}, {0.0, 0.0}};  // of x(T)²
  std::vector<Columns> gains;
  for (long k = 0; k < count; ++k) {
    const double r = m(2, 2) + (b.transpose() * s * b)(0, 0);
    const Columns cross = m.bottomLeftCorner(1, 2) + b.transpose() * s * a;
    gains.insert(gains.begin(), cross / r);
    s = (m.topLeftCorner(2, 2) + a.transpose() * s * a - cross.transpose() * cross / r).eval();
  }
  ControlProblem problem =
      problem_of(oscillator(), {.method = "type1/gl:2", .step = h}, count,
                 conditions_on(1, {{0, 1.0}, {1, 0.5}}, {}), Vector::Zero(1), Vector::Zero(1));
  problem.tolerance = 1e-12;
  const OptimalControlReport report = solve_optimal_control(problem);
  ASSERT_TRUE(report.converged) << report.ending;
  const Vector start{{1.0, 0.5}};
  EXPECT_NEAR(report.cost, 0.5 * start.dot(s * start), 1e-12);
  Vector z = start;
  for (long k = 0; k < count; ++k) {
    const double u = -(gains[static_cast<std::size_t>(k)] * z)(0, 0);
    EXPECT_NEAR(report.controls(0, k), u, 1e-10) << k;
    z = a * z + b * u;
  }
  EXPECT_LT(report.end_of_run, 1e-12);
}

/// With polynomials of degree s − 1 the discrete optimum has an error of high order: that of states and
/// costates is the Riccati equation's.
TEST(Transcription, ConvergesToTheContinuousOptimum) {
  NEEDS_IPOPT();
  const auto cost = [](long count, int degree, const char* method) {
    ControlProblem problem =
        problem_of(oscillator(), {.method = method, .step = 3.0 / static_cast<double>(count)}, count,
                   conditions_on(1, {{0, 1.0}, {1, 0.5}}, {}), Vector::Zero(1), Vector::Zero(1));
    problem.degree = degree;
    problem.tolerance = 1e-11;
    const OptimalControlReport report = solve_optimal_control(problem);
    EXPECT_TRUE(report.converged) << report.ending;
    return report.cost;
  };
  // −dS/dt = Q + SA + AᵀS − SBBᵀS by a fine fourth-order Runge-Kutta method.
  const Columns a{{0.0, 1.0}, {-1.0, 0.0}}, b{{0.0, 0.0}, {0.0, 1.0}};
  const auto rate = [&](const Columns& s) {
    return Columns(Columns::Identity(2, 2) + s * a + a.transpose() * s - s * b * s);
  };
  Columns s{{2.0, 0.0}, {0.0, 0.0}};
  const double h = 1e-3;
  for (int k = 0; k < 3000; ++k) {
    const Columns k1 = rate(s), k2 = rate(s + 0.5 * h * k1), k3 = rate(s + 0.5 * h * k2),
                  k4 = rate(s + h * k3);
    s += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
  }
  const Vector start{{1.0, 0.5}};
  const double exact = 0.5 * start.dot(s * start);
  const auto order = [&](int degree, const char* method) {
    return std::log2(std::abs(cost(10, degree, method) - exact) / std::abs(cost(20, degree, method) - exact));
  };
  EXPECT_NEAR(order(0, "type1/gl:2"), 2.0, 0.2);
  EXPECT_NEAR(order(1, "type1/gl:2"), 4.0, 0.3);
  EXPECT_NEAR(cost(20, 2, "type1/gl:3"), exact, 1e-9);
}

TEST(Transcription, BoundsHold) {
  NEEDS_IPOPT();
  const BoundaryConditions to_rest = conditions_on(1, {{0, 1.0}, {1, 0.0}}, {{0, 0.0}, {1, 0.0}});
  const auto problem_with = [&](const ControlledScene& controlled) {
    return problem_of(controlled, {.method = "type1/gl:2", .step = 0.25}, 20, to_rest, Vector::Ones(1),
                      Vector::Zero(1));
  };
  const OptimalControlReport free = solve_optimal_control(problem_with(oscillator()));
  ASSERT_TRUE(free.converged) << free.ending;
  const double least = 0.8 * free.controls.minCoeff(), greatest = 0.8 * free.controls.maxCoeff();
  const OptimalControlReport bounded = solve_optimal_control(problem_with(oscillator({least, greatest})));
  ASSERT_TRUE(bounded.converged) << bounded.ending;
  EXPECT_LE(bounded.controls.maxCoeff(), greatest);
  EXPECT_GE(bounded.controls.minCoeff(), least);
  EXPECT_NEAR(bounded.controls.maxCoeff(), greatest, 1e-6);
  EXPECT_GT(bounded.cost, free.cost + 1e-6);
  // And of the motion.
  ASSERT_LT(free.q.minCoeff(), -1e-3);
  ControlProblem narrow = problem_with(oscillator());
  narrow.lower_q = Vector{{0.5 * free.q.minCoeff()}};
  narrow.upper_q = Vector{{unbounded}};
  const OptimalControlReport above = solve_optimal_control(narrow);
  ASSERT_TRUE(above.converged) << above.ending;
  EXPECT_GE(above.q.minCoeff(), narrow.lower_q[0]);
  EXPECT_GT(above.cost, free.cost);
}

/// A satellite of unit mass in polar coordinates, pushed along its way: from a circular orbit to one of 1.2
/// times the radius in one revolution, with the least ∫ u² dt (Ober-Blöbaum, Junge, Marsden, section 5.1).
ControlledScene satellite() {
  Scene scene;
  scene.name = "satellite";
  scene.coordinates = {"r", "phi"};
  scene.lagrangian = lagrangian<2>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + q[0] * q[0] * v[1] * v[1]) + 1.0 / q[0];
  });
  scene.start = {0.0, Vector{{1.0, 0.0}}, Vector{{0.0, 1.0}}};
  ControlledScene controlled;
  controlled.scene = std::make_shared<const Scene>(scene);
  controlled.controls = {"u"};
  controlled.force = force<3>([]<class T>(const std::array<T, 3>& q, const std::array<T, 3>&) {
    return std::array<T, 3>{T(0.0), q[0] * q[2], T(0.0)};
  });
  controlled.cost = lagrangian<3>([](const auto& q, const auto&) { return q[2] * q[2]; });
  return controlled;
}

TEST(Transcription, ALowThrustTransferCostsWhatStatesAndCostatesSay) {
  NEEDS_IPOPT();
  const double far = 1.2, time = std::sqrt(4.0 * M_PI * M_PI / 8.0 * std::pow(1.0 + far, 3.0));
  const double slow = std::pow(far, -1.5);
  constexpr long count = 40;
  ControlProblem problem = problem_of(satellite(), {.method = "type1/gl:3", .step = time / count}, count,
                                      conditions_on(2, {{0, 1.0}, {1, 0.0}, {2, 0.0}, {3, 1.0}},
                                                    {{0, far}, {1, 2.0 * M_PI}, {2, 0.0}, {3, slow}}),
                                      Vector{{1.0, 0.0}}, Vector{{far, 2.0 * M_PI}});
  problem.degree = 2;
  const OptimalControlReport report = solve_optimal_control(problem);
  ASSERT_TRUE(report.converged) << report.ending;
  EXPECT_LT(report.end_of_run, 1e-8);
  // The same by Pontryagin's principle: r' = a, φ' = w, a' = r w² − 1/r² , w' = (u − 2 a w)/r, u = l_w/(2r).
  Scene scene;
  scene.name = "costates";
  scene.coordinates = {"r", "phi", "a", "w", "l_r", "l_phi", "l_a", "l_w"};
  scene.lagrangian = lagrangian<8>([](const auto& q, const auto& v) {
    const auto u = q[7] / (2.0 * q[0]);
    return q[4] * (v[0] - q[2]) + q[5] * (v[1] - q[3]) +
           q[6] * (v[2] - q[0] * q[3] * q[3] + 1.0 / (q[0] * q[0])) +
           q[7] * (v[3] + 2.0 * q[2] * q[3] / q[0]) - u * u;
  });
  scene.start = {0.0, Vector{{1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0}}, Vector::Zero(8)};
  const auto& found = report;
  const BoundaryReport exact = solve_boundary_values(
      {std::make_shared<const Scene>(scene),
       Registry::with_built_ins(),
       kinsol(),
       {.method = "type1/gl:3", .step = time / 80},
       80,
       conditions_on(8, {{0, 1.0}, {1, 0.0}, {2, 0.0}, {3, 1.0}},
                     {{0, far}, {1, 2.0 * M_PI}, {2, 0.0}, {3, slow}}),
       [&](double t) {
         const Eigen::Index k = std::min<Eigen::Index>(std::lround(t / time * count), count);
         Vector q = Vector::Zero(8);
         q << found.q.col(k), found.v.col(k), 0.0, 0.0, 0.0,
             2.0 * found.q(0, k) * found.controls(0, std::min<Eigen::Index>(3 * k, 3 * count - 1));
         return GuessedPoint{q, Vector::Zero(8)};
       }});
  ASSERT_TRUE(exact.converged) << exact.ending;
  double cost = 0.0;  // Simpson's rule
  for (long k = 0; k <= 80; ++k)
    cost += (k == 0 || k == 80 ? 1.0
             : k % 2 == 1      ? 4.0
                               : 2.0) *
            std::pow(exact.q(7, k) / (2.0 * exact.q(0, k)), 2.0);
  cost *= time / 80 / 3.0;
  EXPECT_NEAR(report.cost, cost, 1e-5 * cost);
}

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
  const Values at_rest_start{{0, 0.0}, {1, 0.0}, {2, 0.0}, {3, 0.0}, {4, 0.0}, {5, 0.0}};
  const Values at_rest_end{{0, 1.0}, {1, 1.0}, {2, 0.0}, {3, 0.0}, {4, 0.0}, {5, 0.0}};
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
  Values start, end;
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

TEST(Transcription, RefusesWhatItCannotDo) {
  ControlledScene wrong = oscillator();
  wrong.force = satellite().force;
  expect_misuse(
      [&] {
        (void)solve_optimal_control(problem_of(wrong, {.method = "type1/gl:2", .step = 0.1}, 3,
                                               conditions_on(1, {{0, 1.0}}, {}), Vector::Zero(1),
                                               Vector::Zero(1)));
      },
      {"the force's coordinates"});
  if (!optimal_control_available()) {
    expect_misuse(
        [&] {
          (void)solve_optimal_control(problem_of(oscillator(), {.method = "type1/gl:2", .step = 0.1}, 3,
                                                 conditions_on(1, {{0, 1.0}}, {}), Vector::Zero(1),
                                                 Vector::Zero(1)));
        },
        {"needs Ipopt"});
    return;
  }
  // More than two steps with one control each can reach.
  const OptimalControlReport report = solve_optimal_control(problem_of(
      oscillator(), {.method = "type1/gl:2", .step = 0.1}, 1,
      conditions_on(1, {{0, 1.0}, {1, 0.0}}, {{0, 5.0}, {1, 7.0}}), Vector::Zero(1), Vector::Zero(1)));
  EXPECT_FALSE(report.converged);
  EXPECT_FALSE(report.ending.empty());
}

}  // namespace
}  // namespace diracstep
