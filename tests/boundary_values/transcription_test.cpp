#include <Eigen/LU>
#include <cmath>

#include "controlled.hpp"
#include "misuse.hpp"

/// Optimal control with the steps as constraints.
namespace diracstep {
namespace {

using namespace testing;

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
