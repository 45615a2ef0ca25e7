#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/runs/run.hpp>
#include <map>

#include "combinations.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::describe;
using testing::every_kind_of_step;
using testing::for_every_combination;
using testing::integrator_for;
using testing::join;
using testing::samples_of;
using testing::ScenePointer;

// --- Accuracy
// ---------------------------------------------------------------------------------------------------

TEST(Integrator, SparseAndFullMatricesAgree) {
  for (const auto& scene : testing::every_constraint_class())
    for (IntegratorOptions options : every_kind_of_step()) {
      const Sample full = samples_of(scene, options, 20).back();
      options.dense_limit = 0;
      const Sample sparse = samples_of(scene, options, 20).back();
      EXPECT_LT(testing::distance(full.q, sparse.q), 1e-12) << describe(scene, options);
      EXPECT_LT(testing::distance(full.p, sparse.p), 1e-12) << describe(scene, options);
      EXPECT_LT(testing::distance(full.v, sparse.v), 1e-12) << describe(scene, options);
      if (scene->rows() == 0) continue;
      EXPECT_LT(testing::distance(full.lambda, sparse.lambda), 1e-11) << describe(scene, options);
    }
}

/// log2 of the ratio of the errors in (q, projected p) at t = 2 with `steps` and twice as many steps.
double composed_order(const ScenePointer& scene, int order, long steps, const Sample& reference) {
  const auto error = [&](long count) {
    const IntegratorOptions options{.method = "type1/midpoint", .order = order, .step = 2.0 / double(count)};
    const Sample end = samples_of(scene, options, count).back();
    return testing::distance(join(end.q, end.p), join(reference.q, reference.p));
  };
  const double coarse = error(steps), fine = error(2 * steps);
  EXPECT_GT(fine, 1e-12) << "round-off of the reference";
  return std::log2(coarse / fine);
}

TEST(Integrator, CompositionsHaveTheirOrderUnderConstraints) {
  const std::map<int, long> steps{{2, 40}, {4, 10}, {6, 7}, {8, 5}};
  for (const auto& scene : {testing::nonholonomic(), testing::holonomic_sphere(), testing::mixed()}) {
    const Sample reference = samples_of(scene, {.method = "type1/gl:4", .step = 1.0 / 128.0}, 256).back();
    for (const auto& [order, count] : steps)
      EXPECT_NEAR(composed_order(scene, order, count, reference), order, 0.2)
          << scene->name << ", order " << order;
  }
}

TEST(Integrator, StepForwardAndBackReturnsToTheProjectedStart) {
  const std::vector<IntegratorOptions> self_adjoint{{.method = "type1/midpoint", .step = 0.05},
                                                    {.method = "type1/trapezoidal", .step = 0.05},
                                                    {.method = "type1/midpoint", .order = 8, .step = 0.05},
                                                    {.method = "type1/left", .order = 2, .step = 0.05},
                                                    {.method = "type2/euler", .order = 4, .step = 0.05},
                                                    {.method = "type1/gl:3", .step = 0.05}};
  for (const auto& scene : testing::every_constraint_class())
    for (IntegratorOptions options : self_adjoint) {
      const auto forward = samples_of(scene, options, 1);
      auto turned = std::make_shared<Scene>(*scene);
      turned->start = {forward[1].time, forward[1].q, forward[1].v};
      options.step = -options.step;
      const Sample back = samples_of(turned, options, 1).back();
      EXPECT_EQ(back.time, 0.0);
      EXPECT_LT(testing::distance(back.q, forward[0].q), 1e-13) << describe(scene, options);
      EXPECT_LT(testing::distance(back.p, forward[0].p), 1e-12) << describe(scene, options);
    }
}

TEST(Integrator, SeparableTrapezoidalStepIsVelocityVerletWithoutASolve) {
  Scene scene = testing::particle("separable");
  const Vector mass{{1.0, 2.0, 0.5}};
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + 2.0 * v[1] * v[1] + 0.5 * v[2] * v[2]) - q[0] * q[0] * q[1] * q[1] -
           q[2] * q[2];
  });
  const auto force = [](const Vector& q) {
    return Vector{{-2.0 * q[0] * q[1] * q[1], -2.0 * q[0] * q[0] * q[1], -2.0 * q[2]}};
  };
  const double h = 0.05;
  Integrator integrator =
      integrator_for(std::make_shared<const Scene>(scene), {.method = "type1/trapezoidal", .step = h});
  Vector q = scene.start.q, v = scene.start.v;
  Sample sample;
  for (int k = 0; k < 50; ++k) {
    v += h / 2.0 * force(q).cwiseQuotient(mass);
    q += h * v;
    v += h / 2.0 * force(q).cwiseQuotient(mass);
    ASSERT_TRUE(integrator.step().ok());
    ASSERT_TRUE(integrator.sample(Momentum::projected, sample).ok());
    EXPECT_LT(testing::distance(sample.q, q), 1e-14);
    EXPECT_LT(testing::distance(sample.v, v), 1e-13);
  }
  EXPECT_EQ(integrator.work().solves, 0);
  EXPECT_EQ(integrator.work().iterations, 0);
  EXPECT_EQ(integrator.work().steps, 50);
}

/// Checks the order of the error against `exact`, which gives (q, v, Λ) at a time, for steps and compositions
/// of them.
template <class Exact>
void expect_stated_orders(const ScenePointer& scene, double end, Exact exact) {
  for (const IntegratorOptions& options :
       {IntegratorOptions{.method = "type1/midpoint", .order = 2, .step = 0.02},
        {.method = "type1/trapezoidal", .order = 2, .step = 0.02},
        {.method = "type2/legendre(type1/midpoint)", .order = 2, .step = 0.02},
        {.method = "type1/left", .order = 2, .step = 0.02},
        {.method = "type2/euler", .order = 4, .step = 0.05},
        {.method = "type1/midpoint", .order = 4, .step = 0.1},
        {.method = "type1/trapezoidal", .order = 4, .step = 0.1},
        {.method = "type1/gl:2", .order = 4, .step = 0.1}}) {
    const auto error = [&](double h) {
      const StepGrid grid = fit_steps(0.0, end, h);
      IntegratorOptions fitted = options;
      fitted.step = grid.step;
      const Sample last = samples_of(scene, fitted, grid.steps).back();
      return testing::distance(join(join(last.q, last.v), last.lambda), exact(last.time));
    };
    const double coarse = error(options.step), fine = error(options.step / 2.0);
    EXPECT_NEAR(std::log2(coarse / fine), options.order, 0.1) << describe(scene, options);
    EXPECT_LT(fine, 1e-3) << describe(scene, options);
  }
}

TEST(Integrator, DampedOscillatorFromATimeDependentLagrangianConvergesWithTheStatedOrders) {
  // L = e^{2ct} (v² − q²) / 2 gives q'' + 2c q' + q = 0.
  const double c = 0.1, w = std::sqrt(1.0 - c * c);
  Scene scene;
  scene.name = "damped oscillator";
  scene.coordinates = {"x"};
  scene.lagrangian = lagrangian<1>([c](const auto& q, const auto& v, const auto& t) {
    using std::exp;
    return exp(2.0 * c * t) * 0.5 * (v[0] * v[0] - q[0] * q[0]);
  });
  scene.start = {0.0, Vector::Constant(1, 1.0), Vector::Constant(1, -c)};
  expect_stated_orders(std::make_shared<const Scene>(scene), 3.0, [=](double t) {
    const double decay = std::exp(-c * t);
    return Vector{{decay * std::cos(w * t), decay * (-c * std::cos(w * t) - w * std::sin(w * t))}};
  });
}

TEST(Integrator, BeadOnATurningLineConvergesWithTheStatedOrders) {
  // φ = y cos ωt − x sin ωt: r = r0 cosh ωt along the line, Λ = 2 ω r'.
  const double w = 1.3, r0 = 0.4;
  Scene scene;
  scene.name = "turning line";
  scene.coordinates = {"x", "y"};
  scene.lagrangian =
      lagrangian<2>([](const auto&, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]); });
  scene.constraints = {holonomic<2, 1>([w]<class T>(const std::array<T, 2>& q, const T& t) {
    using std::cos, std::sin;
    return std::array<T, 1>{q[1] * cos(w * t) - q[0] * sin(w * t)};
  })};
  scene.start = {0.0, Vector{{r0, 0.0}}, Vector{{0.0, r0 * w}}};
  expect_stated_orders(std::make_shared<const Scene>(scene), 1.5, [=](double t) {
    const double r = r0 * std::cosh(w * t), rate = r0 * w * std::sinh(w * t);
    const double c = std::cos(w * t), s = std::sin(w * t);
    return Vector{{r * c, r * s, rate * c - r * w * s, rate * s + r * w * c, 2.0 * w * rate}};
  });
}

TEST(Integrator, BeltThatMovesUnderAParticleConvergesWithTheStatedOrders) {
  Scene scene;
  scene.name = "belt";
  scene.coordinates = {"x", "y"};
  scene.lagrangian =
      lagrangian<2>([](const auto&, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]); });
  // v_y − x v_x = t: with x' = u,  u' = −Λ x,  y'' = Λ; so Λ = (u² + 1) / (1 + x²).
  scene.constraints = {affine<2, 1>(
      []<class T>(const std::array<T, 2>& q) {
        return std::array<std::array<T, 2>, 1>{{{-q[0], T(1.0)}}};
      },
      []<class T>(const std::array<T, 2>&, const T& t) { return std::array<T, 1>{-t}; })};
  scene.start = {0.0, Vector{{0.3, 0.0}}, Vector{{0.8, 0.24}}};
  const auto shared = std::make_shared<const Scene>(scene);
  // The reduced equation for (x, u), integrated far more finely by the classical Runge–Kutta method.
  expect_stated_orders(shared, 1.5, [](double t) {
    const int steps = 2000;
    const double h = t / steps;
    using State = Eigen::Vector3d;  // x, u, y
    const auto force = [](double x, double u) { return (u * u + 1.0) / (1.0 + x * x); };
    const auto rate = [&](double time, const State& s) {
      return State(s[1], -force(s[0], s[1]) * s[0], s[0] * s[1] + time);
    };
    State s(0.3, 0.8, 0.0);
    for (int k = 0; k < steps; ++k) {
      const double now = k * h;
      const State a = rate(now, s), b = rate(now + h / 2.0, s + h / 2.0 * a),
                  c = rate(now + h / 2.0, s + h / 2.0 * b), d = rate(now + h, s + h * c);
      s += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
    }
    return Vector{{s[0], s[2], s[1], s[0] * s[1] + t, force(s[0], s[1])}};
  });
}

TEST(Integrator, SmoothScenesTakeAtMostTwoIterationsASolve) {
  for_every_combination([](const ScenePointer& scene, IntegratorOptions options) {
    options.step = 0.01;
    Integrator integrator = integrator_for(scene, options);
    ASSERT_TRUE(run_steps(integrator, 200, Momentum::plus, 1, nullptr).ok());
    EXPECT_LE(integrator.work().iterations, 2 * integrator.work().solves);
    EXPECT_GE(integrator.work().solves, 200);
  });
}

}  // namespace
}  // namespace diracstep
