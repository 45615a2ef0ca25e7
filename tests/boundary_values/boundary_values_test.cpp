#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "misuse.hpp"
#include "solved.hpp"

namespace diracstep {
namespace {

using namespace testing;

/// All of q0, and as many of the first coordinates at the end as the rows leave to be asked.
BoundaryConditions start_and_part_of_the_end(const Vector& q0, const Vector& qN, int count) {
  const BoundaryConditions all = between(q0, qN);
  const Eigen::Index rows = q0.size() + count;
  return {all.at_start.topRows(rows), all.at_end.topRows(rows), all.value.head(rows), true, false, false};
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
