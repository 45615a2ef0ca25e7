#include <gtest/gtest.h>

#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/step_loop.hpp>
#include <diracstep/core/steps/radau/tableau.hpp>

#include "differences.hpp"
#include "methods.hpp"
#include "scenes.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::join;
using testing::samples_of;

std::string radau(int s) { return "damped/radau:" + std::to_string(s); }

TEST(RadauTableau, HasTheKnownCoefficients) {
  const RadauTableau one = radau_tableau(1), two = radau_tableau(2), three = radau_tableau(3);
  EXPECT_EQ(one.a(0, 0), 1.0);
  EXPECT_NEAR(two.c[0], 1.0 / 3.0, 1e-16);
  EXPECT_NEAR(two.a(0, 0), 5.0 / 12.0, 1e-16);
  EXPECT_NEAR(two.a(0, 1), -1.0 / 12.0, 1e-16);
  const double r = std::sqrt(6.0);
  EXPECT_NEAR(three.c[0], (4.0 - r) / 10.0, 1e-16);
  EXPECT_NEAR(three.a(0, 0), (88.0 - 7.0 * r) / 360.0, 1e-16);
  EXPECT_NEAR(three.a(2, 1), (16.0 + r) / 36.0, 1e-16);
  EXPECT_THROW(radau_tableau(0), Misuse);
  EXPECT_THROW(radau_tableau(6), Misuse);
}

TEST(RadauTableau, IsStifflyAccurateOfItsOrderForEveryNumberOfStages) {
  for (int s = 1; s <= most_radau_stages; ++s) {
    const RadauTableau t = radau_tableau(s);
    EXPECT_EQ(t.c[s - 1], 1.0) << s;
    EXPECT_LT((t.a.rowwise().sum() - t.c).lpNorm<Eigen::Infinity>(), 1e-15) << s;
    for (int power = 0; power <= 2 * s - 2; ++power) {  // ∫ x^k by the weights, the last row of a
      double moment = 0.0;
      for (int i = 0; i < s; ++i) moment += t.a(s - 1, i) * std::pow(t.c[i], power);
      EXPECT_NEAR(moment, 1.0 / (power + 1.0), 1e-15) << s << " x^" << power;
    }
  }
}

/// A holonomic scene with ∂²L/∂q∂v = 0, which a step need not look at.
std::shared_ptr<const Scene> separable_on_sphere() {
  Scene scene = *testing::holonomic_sphere();
  scene.name = "separable, holonomic";
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1] + 2.0 * v[2] * v[2]) - q[0] * q[0] * q[1] - q[2] * q[2];
  });
  return std::make_shared<const Scene>(scene);
}

TEST(RadauStep, JacobianAgreesWithDifferences) {
  std::vector<std::shared_ptr<const Scene>> scenes{testing::driven(), laws::degenerate_circuit(),
                                                   separable_on_sphere()};
  for (const auto& plain : testing::every_constraint_class()) {
    scenes.push_back(plain);
    scenes.push_back(testing::forced(plain));
  }
  for (const int s : {1, 2, 3})
    for (const auto& scene : scenes)
      for (const bool dense : {true, false}) {
        const auto problem = Registry::with_built_ins().method(radau(s)).make_step(*scene, {dense});
        Vector p(3), lq(3), x(problem->size());
        scene->lagrangian->gradient(0.0, scene->start.q, scene->start.v, lq, p);
        problem->begin({0.0, 0.2}, {scene->start.q, p, scene->start.v}, {});
        problem->guess(scene->start.v, x);
        x += 0.2 * Vector::LinSpaced(x.size(), -1.0, 1.3);
        EXPECT_LT(testing::jacobian_error(*problem, x), 2e-8) << scene->name << " s = " << s;
      }
}

/// Error in q, v and the multipliers at t = 3.6 with N steps; infinite where they are too coarse to be
/// solved.
double error_with(const std::shared_ptr<const Scene>& scene, int s, long steps, const Sample& reference) {
  Integrator integrator(scene, Registry::with_built_ins(), kinsol(),
                        {.method = radau(s), .step = 3.6 / static_cast<double>(steps)});
  Sample end;
  if (!take_steps(integrator, steps).ok() || !integrator.sample(Momentum::projected, end).ok())
    return HUGE_VAL;
  return join(join(end.q - reference.q, end.v - reference.v), end.lambda - reference.lambda)
      .lpNorm<Eigen::Infinity>();
}

TEST(RadauStep, OrderIsTwiceTheStagesLessOneInConfigurationVelocityAndMultipliers) {
  std::vector<std::shared_ptr<const Scene>> scenes{testing::driven(), laws::degenerate_circuit(),
                                                   laws::phase_space()};
  for (const auto& plain : testing::every_constraint_class()) {
    scenes.push_back(plain);
    scenes.push_back(testing::forced(plain));
  }
  constexpr std::array<double, 6> to_show{0.0,  3e-3, 1e-5,
                                          1e-6, 1e-7, 1e-7};  // errors small enough for the order
  for (const auto& scene : scenes) {
    const Sample reference = samples_of(scene, {.method = testing::gl(6), .step = 3.6 / 144}, 144).back();
    for (int s = 1; s <= most_radau_stages; ++s) {
      long steps = 4;
      double first = error_with(scene, s, steps, reference);
      while (first > to_show.at(static_cast<std::size_t>(s)))
        first = error_with(scene, s, steps *= 2, reference);
      const double second = error_with(scene, s, 2 * steps, reference);
      const double order = std::log2(first / second);
      if (s == 5) {  // round-off comes before the highest order shows everywhere
        EXPECT_GT(order, 7.5) << scene->name << " errors " << first << " " << second;
        continue;
      }
      EXPECT_GT(second, 1e-13) << scene->name << ": at round-off, nothing is measured";
      EXPECT_NEAR(order, 2.0 * s - 1.0, 0.35)
          << scene->name << " s = " << s << " errors " << first << " " << second;
    }
  }
}

TEST(RadauStep, EndsOnAllRows) {
  for (const auto& scene : {testing::holonomic_sphere(), testing::mixed(), testing::driven()})
    for (const Sample& at : samples_of(scene, {.method = radau(2), .step = 0.1}, 200))
      for (const auto& rows : scene->constraints) {
        Vector a(rows->pattern().nonzeros()), residual(rows->rows());
        rows->coefficients(at.time, at.q, a, residual);
        rows->pattern().multiply_add(a.data(), at.v.data(), residual.data());
        EXPECT_LT(residual.lpNorm<Eigen::Infinity>(), 1e-13) << scene->name;
        if (!rows->holonomic()) continue;
        rows->position(at.time, at.q, residual);
        EXPECT_LT(residual.lpNorm<Eigen::Infinity>(), 1e-14) << scene->name;
      }
}

/// m = 1 on a spring of stiffness k with a resistance c.
std::shared_ptr<const Scene> oscillator(double k, double c) {
  Scene scene;
  scene.name = "oscillator";
  scene.coordinates = {"x"};
  scene.lagrangian =
      lagrangian<1>([k](const auto& q, const auto& v) { return 0.5 * v[0] * v[0] - 0.5 * k * q[0] * q[0]; });
  if (c > 0.0)
    scene.force = force<1>([c]<class T>(const std::array<T, 1>&, const std::array<T, 1>& v) {
      return std::array<T, 1>{-c * v[0]};
    });
  scene.start = {0.0, Vector::Ones(1), Vector::Ones(1)};
  return std::make_shared<const Scene>(scene);
}

/// What one step of size 1 leaves of a state of size 1, with the momentum in units of √k.
double left_after_a_step(const std::string& method, double k, double c) {
  const Sample end = samples_of(oscillator(k, c), {.method = method, .step = 1.0}, 1).back();
  return std::max(std::abs(end.q[0]), std::abs(end.v[0]) / std::sqrt(k));
}

/// |R(z)| falls like 1/|z|, to zero, on what vibrates and on what is damped; that of GL(2) tends to one.
TEST(RadauStep, DampsWhatIsTooFast) {
  for (int s = 1; s <= most_radau_stages; ++s)
    for (const double c : {0.0, 1.0}) {
      const double k = 1e12, stiff = left_after_a_step(radau(s), k, c * std::sqrt(k));
      EXPECT_LT(stiff, 10.0 * s * s / std::sqrt(k)) << s;
      EXPECT_NEAR(left_after_a_step(radau(s), 1e4 * k, c * std::sqrt(1e4 * k)) / stiff, 1e-2, 1e-3) << s;
    }
  EXPECT_GT(left_after_a_step(testing::gl(2), 1e12, 0.0), 0.99);
}

TEST(RadauStep, HasNoGeneratingFunctionAndSaysSo) {
  const Registry registry = Registry::with_built_ins();
  const Method method = registry.method(radau(3));
  EXPECT_FALSE(method.generating_function);
  EXPECT_FALSE(method.info.type);
  EXPECT_FALSE(method.info.self_adjoint);
  EXPECT_TRUE(method.info.damped);
  EXPECT_EQ(method.info.order, 5);
  EXPECT_THROW((void)registry.adjoint_of(method), Misuse);
  for (const char* name : {"damped/radau:0", "damped/radau:6", "damped/radau:x", "damped/radau:",
                           "type1/adjoint(damped/radau:2)", "type2/legendre(damped/radau:2)"})
    EXPECT_THROW((void)registry.method(name), Misuse) << name;
  const auto scene = testing::nonholonomic();
  const auto integrator = [&](const IntegratorOptions& options) {
    Integrator(scene, registry, kinsol(), options);
  };
  EXPECT_THROW(integrator({.method = radau(3), .order = 6, .step = 0.1}), Misuse);
  EXPECT_THROW(
      integrator({.method = radau(3), .step = 0.1, .constraint_rule = ConstraintRule(StepRule::left)}),
      Misuse);
  EXPECT_THROW(integrator({.method = radau(3), .step = 0.1, .compensated_sums = true}), Misuse);
}

TEST(RadauStep, ARestoredRunHasTheSameBits) {
  for (const auto& scene : {testing::forced(testing::mixed()), laws::phase_space()}) {
    const IntegratorOptions options{.method = radau(3), .step = 0.1};
    const auto make = [&] { return Integrator(scene, Registry::with_built_ins(), kinsol(), options); };
    Integrator straight = make(), restored = make();
    ASSERT_TRUE(take_steps(straight, 10).ok());
    restored.restore(straight.save());
    ASSERT_TRUE(take_steps(straight, 10).ok() && take_steps(restored, 10).ok());
    EXPECT_EQ(straight.position(), restored.position()) << scene->name;
    EXPECT_EQ(straight.momentum(), restored.momentum()) << scene->name;
  }
}

/// An end is on the distribution, so that no impulse belongs to the start of the next step.
TEST(RadauStep, MomentaBeforeAndAfterAreTheProjectedOne) {
  const auto scene = testing::mixed();
  const IntegratorOptions options{.method = radau(3), .step = 0.1};
  const Sample projected = samples_of(scene, options, 5).back();
  for (const Momentum momentum : {Momentum::plus, Momentum::minus}) {
    const Sample sample = samples_of(scene, options, 5, momentum).back();
    EXPECT_LT((sample.p - projected.p).lpNorm<Eigen::Infinity>(), 1e-14);
  }
}

}  // namespace
}  // namespace diracstep
