#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <diracstep/boundary_values/boundary_values.hpp>

#include "combinations.hpp"
#include "misuse.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using namespace testing;

constexpr long steps = 20;

BoundaryReport solved(const ScenePointer& scene, const IntegratorOptions& options,
                      const BoundaryConditions& conditions, const GuessedMotion& guess, long count = steps,
                      const Registry& registry = Registry::with_built_ins()) {
  return solve_boundary_values({scene, registry, kinsol(), options, count, conditions, guess});
}

GuessedMotion line_between(const ScenePointer& scene, const IntegratorOptions& options, const Vector& q0,
                           const Vector& qN, long count = steps) {
  const double t0 = scene->start.time;
  return straight_line(t0, q0, t0 + static_cast<double>(count) * options.step, qN);
}

/// All of q0, and as many of the first coordinates at the end as the rows leave to be asked.
BoundaryConditions start_and_part_of_the_end(const Vector& q0, const Vector& qN, int count) {
  const BoundaryConditions all = between(q0, qN);
  const Eigen::Index rows = q0.size() + count;
  return {all.at_start.topRows(rows), all.at_end.topRows(rows), all.value.head(rows), true, false, false};
}

/// The motion of the integrator from the start that was found.
void expect_motion(const ScenePointer& scene, const IntegratorOptions& options, const BoundaryReport& report,
                   double bound) {
  Integrator integrator = integrator_for(scene, options);
  Start start = scene->start;
  start.q = report.q.col(0);
  start.v = report.v.col(0);
  integrator.reset(start);
  for (Eigen::Index k = 1; k < report.times.size(); ++k) ASSERT_TRUE(integrator.step().ok());
  Sample end;
  ASSERT_TRUE(integrator.sample(Momentum::projected, end).ok());
  EXPECT_LT(distance(end.q, report.q.rightCols(1)), bound);
  EXPECT_LT(distance(end.v, report.v.rightCols(1)), bound);
  EXPECT_LT(distance(end.p, report.p.rightCols(1)), bound);
}

TEST(BoundaryValues, AreThoseOfAMotionForEveryStepAndClass) {
  std::vector<ScenePointer> scenes(every_constraint_class().begin(), every_constraint_class().end());
  for (const auto& scene : {unconstrained(), nonholonomic(), mixed()}) scenes.push_back(forced(scene));
  scenes.push_back(driven());
  std::vector<IntegratorOptions> kinds = every_kind_of_step();
  for (const char* method : {"damped/radau:2", "type1/gl:3", "type2/gl:2", "type2/legendre(type1/midpoint)",
                             "type1/left", "type3/euler", "type4/legendre(type1/midpoint)"})
    kinds.push_back({.method = method, .step = 0.05});
  for (const auto& scene : scenes)
    for (const IntegratorOptions& options : kinds) {
      if (scene->force && options.method.starts_with("type4")) continue;
      SCOPED_TRACE(describe(scene, options));
      const Sample end =
          samples_of(scene, options, steps, Momentum::projected, Registry::with_built_ins(), steps).back();
      const int holonomic = row_count(only_holonomic(scene->constraints));
      const bool both = holonomic == scene->rows();
      const BoundaryConditions conditions =
          both ? between(scene->start.q, end.q)
               : start_and_part_of_the_end(scene->start.q, end.q, scene->dimension() - scene->rows());
      const BoundaryReport report =
          solved(scene, options, conditions, line_between(scene, options, scene->start.q, end.q));
      ASSERT_TRUE(report.converged) << report.ending;
      EXPECT_LE(report.iterations, 10);  // of second order: the derivatives are exact
      EXPECT_LT(distance(report.q.col(0), scene->start.q), 1e-12);
      EXPECT_LT(distance(report.q.rightCols(1), end.q), 1e-11);
      expect_motion(scene, options, report, 1e-10);
      const bool generates = both && !scene->force && !options.method.starts_with("damped");
      EXPECT_EQ(report.action.has_value(), generates) << report.no_action;
      EXPECT_EQ(report.no_action.empty(), generates);
    }
}

/// The action of the motion between places off those by (a, b).
double action_of(const ScenePointer& scene, const IntegratorOptions& options, const Vector& q0,
                 const Vector& qN) {
  const BoundaryReport report = solved(scene, options, between(q0, qN), line_between(scene, options, q0, qN));
  EXPECT_TRUE(report.converged) << report.ending;
  return report.action ? report.action->value : std::nan("");
}

TEST(BoundaryValues, TheDerivativesOfTheActionAreThoseOfDifferences) {
  const ScenePointer scene = unconstrained();
  Vector qN = scene->start.q;
  qN += Vector{{0.4, -0.3, 0.5}};
  for (const char* method :
       {"type1/gl:2", "type1/midpoint", "type1/trapezoidal", "type2/euler", "type3/euler",
        "type2/legendre(type1/midpoint)", "type4/legendre(type1/midpoint)"})
    for (const int order : {0, 4}) {
      if (order == 4 && std::string(method) != "type1/midpoint" && std::string(method) != "type2/euler")
        continue;
      const IntegratorOptions options{.method = method, .order = order, .step = 0.05};
      SCOPED_TRACE(describe(scene, options));
      const BoundaryReport report = solved(scene, options, between(scene->start.q, qN),
                                           line_between(scene, options, scene->start.q, qN));
      ASSERT_TRUE(report.converged && report.action) << report.ending << report.no_action;
      const Vector a{{0.3, -0.5, 0.7}}, b{{-0.2, 0.6, 0.4}};
      const auto at = [&](double s) { return action_of(scene, options, scene->start.q + s * a, qN + s * b); };
      const double s = 2e-2;
      const double first =
          (45.0 * (at(s) - at(-s)) - 9.0 * (at(2 * s) - at(-2 * s)) + (at(3 * s) - at(-3 * s))) / (60.0 * s);
      EXPECT_NEAR(report.action->gradient.dot(join(a, b)), first, 1e-9);
      const Columns& hessian = report.action->hessian;
      ASSERT_EQ(hessian.rows(), 6);
      EXPECT_LT((hessian - hessian.transpose()).lpNorm<Eigen::Infinity>(), 1e-11 * hessian.norm());
      const double second =
          (-(at(2 * s) + at(-2 * s)) + 16.0 * (at(s) + at(-s)) - 30.0 * at(0.0)) / (12.0 * s * s);
      EXPECT_NEAR(join(a, b).dot(hessian * join(a, b)), second, 1e-6);
      EXPECT_LT(distance(report.action->gradient, join(-report.p.col(0), report.p.rightCols(1))), 1e-12);
    }
}

TEST(BoundaryValues, OnHolonomicRowsTheActionGivesTheMomentaAlongThem) {
  const ScenePointer scene = holonomic_sphere();
  const auto on_sphere = [](double x, double y) {
    return Vector{{x, y, std::sqrt(2.0 * (1.5 - x * x - y * y))}};
  };
  const Vector q0 = on_sphere(1.0, 0.5), qN = on_sphere(0.7, 0.1);
  for (const char* method : {"type1/gl:3", "type1/midpoint", "type2/euler"}) {
    SCOPED_TRACE(method);
    const IntegratorOptions options{.method = method, .step = 0.05};
    const BoundaryReport report =
        solved(scene, options, between(q0, qN), line_between(scene, options, q0, qN));
    ASSERT_TRUE(report.converged && report.action) << report.ending;
    EXPECT_EQ(report.action->hessian.size(), 0);
    const auto at = [&](double s) {
      return action_of(scene, options, on_sphere(1.0 + 0.3 * s, 0.5 - 0.2 * s),
                       on_sphere(0.7 - 0.1 * s, 0.1 + s));
    };
    const double s = 1e-2;
    const double exact =
        report.action->gradient.dot(join(Vector{{0.3, -0.2, -2.0 * (0.3 * 1.0 - 0.2 * 0.5) / q0[2]}},
                                         Vector{{-0.1, 1.0, -2.0 * (-0.1 * 0.7 + 1.0 * 0.1) / qN[2]}}));
    const double difference =
        (45.0 * (at(s) - at(-s)) - 9.0 * (at(2 * s) - at(-2 * s)) + (at(3 * s) - at(-3 * s))) / (60.0 * s);
    EXPECT_NEAR(exact, difference, 1e-9);
  }
}

ScenePointer kepler() {
  Scene scene;
  scene.name = "kepler";
  scene.coordinates = {"x", "y"};
  scene.lagrangian = lagrangian<2>([](const auto& q, const auto& v) {
    using std::sqrt;
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) + 1.0 / sqrt(q[0] * q[0] + q[1] * q[1]);
  });
  scene.start = {0.0, Vector{{1.0, 0.0}}, Vector{{0.0, 1.0}}};
  return std::make_shared<const Scene>(scene);
}

/// Lambert's problem with universal variables (Bate, Mueller, White, Fundamentals of Astrodynamics, 5.3),
/// gravity 1: the velocity at r1 of the orbit that takes the short way to r2 in this time.
Vector lambert(const Vector& r1, const Vector& r2, double time) {
  const double a = r1.norm(), b = r2.norm(), cosine = r1.dot(r2) / (a * b);
  const double constant = std::sqrt(a * b * (1.0 + cosine));
  const auto c = [](double z) {
    return z > 0.0 ? (1.0 - std::cos(std::sqrt(z))) / z : (std::cosh(std::sqrt(-z)) - 1.0) / -z;
  };
  const auto s = [](double z) {
    const double root = std::sqrt(std::abs(z));
    return (z > 0.0 ? root - std::sin(root) : std::sinh(root) - root) / (root * root * root);
  };
  const auto y = [&](double z) { return a + b - constant * (1.0 - z * s(z)) / std::sqrt(c(z)); };
  const auto time_of = [&](double z) {
    const double x = std::sqrt(y(z) / c(z));
    return x * x * x * s(z) + constant * std::sqrt(y(z));
  };
  double low = 1e-3, high = 30.0;  // ellipses
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (time_of(middle) < time ? low : high) = middle;
  }
  const double f = 1.0 - y(low) / a, g = constant * std::sqrt(y(low));
  return (r2 - f * r1) / g;
}

TEST(BoundaryValues, LambertsProblemIsSolvedWithTheOrderOfTheMethod) {
  const ScenePointer scene = kepler();
  const Vector q0{{1.0, 0.0}}, qN{{-0.3, 1.1}};
  const double time = 2.1;
  const Vector exact = lambert(q0, qN, time);
  const auto error = [&](const char* method, long count) {
    const IntegratorOptions options{.method = method, .step = time / static_cast<double>(count)};
    const BoundaryReport report =
        solved(scene, options, between(q0, qN), line_between(scene, options, q0, qN, count), count);
    EXPECT_TRUE(report.converged) << report.ending;
    return distance(report.v.col(0), exact);
  };
  EXPECT_LT(error("type1/gl:6", 40), 2e-13);
  for (const auto& [method, order] : {std::pair{"type1/gl:1", 2}, {"type1/gl:2", 4}, {"type1/gl:3", 6}}) {
    const double ratio = error(method, 15) / error(method, 30);
    EXPECT_NEAR(std::log2(ratio), order, 0.25) << method;
  }
}

/// H_d+(q0, p1) = p1ᵀF q0 + p1ᵀG p1/2 + q0ᵀQ q0/2.
struct LinearQuadratic {
  Columns f{{1.1, 0.2}, {0.0, 1.05}};
  Columns g{{0.0, 0.0}, {0.0, 0.5}};    // B R⁻¹ Bᵀ with B = (0, 1)ᵀ, R = 2
  Columns q{{-1.0, 0.1}, {0.1, -0.4}};  // less the cost of the state
};

class LinearQuadraticFunction final : public GeneratingFunction {
 public:
  LinearQuadraticFunction() : GeneratingFunction(GeneratingType::two, SparsityPattern::dense(2, 2)) {}
  double value(Interval, ConstColumnsRef y) override {
    return y.col(1).dot(m_.f * y.col(0)) + 0.5 * y.col(1).dot(m_.g * y.col(1)) +
           0.5 * y.col(0).dot(m_.q * y.col(0));
  }
  void gradient(Interval, ConstColumnsRef y, ColumnsRef out) override {
    out.col(0) = m_.f.transpose() * y.col(1) + m_.q * y.col(0);
    out.col(1) = m_.f * y.col(0) + m_.g * y.col(1);
  }
  void hessian(Interval, ConstColumnsRef, ColumnsRef blocks) override {
    blocks.col(0) = m_.q.reshaped();
    blocks.col(1) = Columns(m_.f.transpose()).reshaped();
    blocks.col(2) = m_.g.reshaped();
  }

 private:
  LinearQuadratic m_;
};

TEST(BoundaryValues, TheLinearQuadraticCaseIsTheRiccatiRecursion) {
  Registry registry = Registry::with_built_ins();
  registry.add({"type2/linear-quadratic", GeneratingType::two, 1, false, StepRule::left, "for a test"},
               [](const Scene&) { return std::make_unique<LinearQuadraticFunction>(); });
  Scene scene;
  scene.name = "linear-quadratic";
  scene.coordinates = {"x", "y"};
  scene.lagrangian =
      lagrangian<2>([](const auto&, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]); });
  scene.start = {0.0, Vector::Zero(2), Vector::Zero(2)};
  const auto shared = std::make_shared<const Scene>(scene);
  const IntegratorOptions options{.method = "type2/linear-quadratic", .step = 1.0};
  // The longest grows beyond what could be resolved from one end.
  for (const long count : {3L, 30L, 300L}) {
    SCOPED_TRACE(count);
    const LinearQuadratic m;
    const Columns last{{-3.0, 0.0}, {0.0, -2.0}};
    Columns a = last;
    for (long k = 0; k < count; ++k)
      a = (m.q + m.f.transpose() * a * (Columns::Identity(2, 2) - m.g * a).inverse() * m.f).eval();
    // q0 given, pN = A_N qN.
    for (int i = 0; i < 2; ++i) {
      BoundaryConditions conditions{Columns::Zero(4, 6), Columns::Zero(4, 6), Vector::Zero(4)};
      conditions.at_start.topLeftCorner(2, 2).setIdentity();
      conditions.at_end.bottomLeftCorner(2, 2) = -last;
      conditions.at_end.bottomRightCorner(2, 2).setIdentity();
      conditions.value[i] = 1.0;
      const BoundaryReport report = solved(
          shared, options, conditions,
          [](double) {
            return GuessedPoint{Vector::Zero(2), Vector::Zero(2)};
          },
          count, registry);
      ASSERT_TRUE(report.converged) << report.ending;
      EXPECT_LT(distance(report.p.col(0), a.col(i)), 1e-12);
      ASSERT_TRUE(report.action);
      if (count > 30) continue;  // S^N(q0, qN) itself is stiff there
      // The same from S^N: stationary in qN with the cost of the end added.
      const Columns& s = report.action->hessian;
      const Columns from_action = -s.topLeftCorner(2, 2) - s.topRightCorner(2, 2) *
                                                               (last - s.bottomRightCorner(2, 2)).inverse() *
                                                               s.bottomLeftCorner(2, 2);
      EXPECT_LT((from_action - a).lpNorm<Eigen::Infinity>(), 1e-11);
    }
  }
}

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

TEST(BoundaryValues, RefuseWhatDoesNotDetermineAMotion) {
  const IntegratorOptions options{.method = "type1/gl:2", .step = 0.05};
  const auto expect = [&](const ScenePointer& scene, const BoundaryConditions& conditions,
                          std::initializer_list<std::string> words) {
    const Vector q = scene->start.q;
    expect_misuse([&] { (void)solved(scene, options, conditions, line_between(scene, options, q, q)); },
                  words);
  };
  const Vector q = nonholonomic()->start.q;
  expect(nonholonomic(), between(q, q + Vector::Ones(3)),
         {"5 conditions", "6 are given", "1 nonholonomic rows", "2 dimensions"});
  expect(unconstrained(), start_and_part_of_the_end(q, q, 2), {"6 conditions", "5 are given"});
  expect(holonomic_sphere(), between(holonomic_sphere()->start.q, Vector{{1.0, 0.5, 0.8}}),
         {"the end", "row 'sphere'"});
  const Vector place = phase_space()->start.q;
  expect(phase_space(), between(place, place), {"2 conditions", "4 are given", "linear in v"});
  expect_misuse(
      [&] {
        (void)solved(unconstrained(), options, between(q, q), line_between(unconstrained(), options, q, q),
                     0);
      },
      {"0 steps"});
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

TEST(BoundaryValues, SayWhyASearchHasNotConverged) {
  const IntegratorOptions options{.method = "type1/gl:2", .step = 0.05};
  // A straight line through the centre of attraction.
  const Vector one{{1.0, 0.0}};
  const BoundaryReport through =
      solved(kepler(), options, between(one, -one), line_between(kepler(), options, one, -one));
  EXPECT_FALSE(through.converged);
  expect_parts(through.ending, {"not converged", "a guess nearer to a solution"});
  // Periodic conditions that no motion fulfils.
  Scene scene;
  scene.name = "falling";
  scene.coordinates = {"x"};
  scene.lagrangian = lagrangian<1>([](const auto& q, const auto& v) { return 0.5 * v[0] * v[0] + q[0]; });
  scene.start = {0.0, Vector::Ones(1), Vector::Zero(1)};
  const auto falling = std::make_shared<const Scene>(scene);
  const Vector place = Vector::Ones(1);
  const BoundaryReport none =
      solved(falling, options, periodic(1), line_between(falling, options, place, place));
  EXPECT_FALSE(none.converged);
  EXPECT_FALSE(none.ending.empty());
}

}  // namespace
}  // namespace diracstep
