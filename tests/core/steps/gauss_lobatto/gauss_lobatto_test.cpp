#include <gtest/gtest.h>

#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>

#include "differences.hpp"
#include "methods.hpp"
#include "scenes.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::join;
using testing::samples_of;

TEST(GaussLobattoTableau, HasTheKnownCoefficients) {
  const GaussLobattoTableau one = gauss_lobatto_tableau(1), two = gauss_lobatto_tableau(2);
  EXPECT_EQ(one.a(0, 0), 0.5);
  EXPECT_EQ(one.e(0, 0), 0.5);
  EXPECT_EQ(one.e(0, 1), 0.0);
  const double r = std::sqrt(3.0);
  EXPECT_NEAR(two.c[0], 0.5 - r / 6.0, 1e-16);
  EXPECT_NEAR(two.lobatto_a(1, 0), 0.25 + r / 8.0, 1e-16);
  EXPECT_NEAR(two.e(0, 0), 1.0 / 6.0, 1e-16);
  EXPECT_NEAR(two.e(0, 1), 1.0 / 3.0 - r / 6.0, 1e-16);
  EXPECT_NEAR(two.lobatto_b[1], 2.0 / 3.0, 1e-16);
  EXPECT_THROW(gauss_lobatto_tableau(0), Misuse);
  EXPECT_THROW(gauss_lobatto_tableau(21), Misuse);
}

TEST(GaussLobattoTableau, SatisfiesItsIdentitiesForEveryNumberOfStages) {
  for (int s = 1; s <= 20; ++s) {
    const GaussLobattoTableau t = gauss_lobatto_tableau(s);
    EXPECT_NEAR(t.b.sum(), 1.0, 1e-15) << s;
    EXPECT_NEAR(t.lobatto_b.sum(), 1.0, 1e-15) << s;
    EXPECT_LT((t.e.rowwise().sum() - t.c).lpNorm<Eigen::Infinity>(), 1e-14) << s;
    EXPECT_LT((t.a - t.a_hat).cwiseAbs().maxCoeff(), 1e-14) << s;  // Gauss is symplectic
    EXPECT_LT((t.a.rowwise().sum() - t.c).lpNorm<Eigen::Infinity>(), 1e-14) << s;
    double moment = 0.0;  // ∫ x^{2s−1} by both rules
    for (int i = 0; i < s; ++i) moment += t.b[i] * std::pow(t.c[i], 2 * s - 1);
    EXPECT_NEAR(moment, 1.0 / (2.0 * s), 1e-15) << s;
    moment = 0.0;
    for (int j = 0; j <= s; ++j) moment += t.lobatto_b[j] * std::pow(t.lobatto_c[j], 2 * s - 1);
    EXPECT_NEAR(moment, 1.0 / (2.0 * s), 1e-15) << s;
  }
}

TEST(GaussLobattoStep, JacobianAgreesWithDifferences) {
  for (const int s : {1, 2, 3})
    for (const auto& plain : testing::every_constraint_class())
      for (const auto& scene : {plain, testing::forced(plain)})
        for (const bool dense : {true, false}) {
          const auto problem = Registry::with_built_ins().method(testing::gl(s)).make_step(*scene, {dense});
          Vector p(3), lq(3), x(problem->size());
          scene->lagrangian->gradient(0.0, scene->start.q, scene->start.v, lq, p);
          problem->begin({0.0, 0.2}, {scene->start.q, p, scene->start.v}, {});
          problem->guess(scene->start.v, x);
          x += 0.2 * Vector::LinSpaced(x.size(), -1.0, 1.3);
          EXPECT_LT(testing::jacobian_error(*problem, x), 2e-8) << scene->name << " s = " << s;
        }
}

/// The midpoint step as the graph of its generating function, without the velocity form that the registry
/// gives it.
Registry with_plain_midpoint() {
  Registry registry = Registry::with_built_ins();
  MethodInfo info = registry.method("type1/midpoint").info;
  info.name = "type1/plain_midpoint";
  registry.add(info, registry.method("type1/midpoint").generating_function);
  return registry;
}

TEST(GaussLobattoStep, OneStageIsTheMidpointStep) {
  for (const auto& scene : testing::every_constraint_class()) {
    const auto midpoint = samples_of(scene, {.method = "type1/plain_midpoint", .step = 0.05}, 20,
                                     Momentum::projected, with_plain_midpoint())
                              .back();
    const auto gauss = samples_of(scene, {.method = testing::gl(1), .step = 0.05}, 20).back();
    EXPECT_LT((gauss.q - midpoint.q).lpNorm<Eigen::Infinity>(), 1e-13) << scene->name;
    EXPECT_LT((gauss.p - midpoint.p).lpNorm<Eigen::Infinity>(), 1e-12) << scene->name;
  }
}

TEST(GaussLobattoStep, PlusAndMinusMomentaAreThoseOfTheMidpointStepForOneStage) {
  const auto scene = testing::nonholonomic();
  for (const Momentum momentum : {Momentum::plus, Momentum::minus}) {
    const auto midpoint = samples_of(scene, {.method = "type1/plain_midpoint", .step = 0.05}, 3, momentum,
                                     with_plain_midpoint())
                              .back();
    const auto gauss = samples_of(scene, {.method = testing::gl(1), .step = 0.05}, 3, momentum).back();
    EXPECT_LT((gauss.p - midpoint.p).lpNorm<Eigen::Infinity>(), 1e-13);
  }
}

/// Error in q, v and the multipliers at t = 3.6 with N steps.
double error_with(const std::shared_ptr<const Scene>& scene, const std::string& method, long steps,
                  const Sample& reference) {
  const auto end =
      samples_of(scene, {.method = method, .step = 3.6 / static_cast<double>(steps)}, steps).back();
  const Vector difference =
      join(join(end.q - reference.q, end.v - reference.v), end.lambda - reference.lambda);
  return difference.lpNorm<Eigen::Infinity>();
}

void expect_order(const std::shared_ptr<const Scene>& scene, int s, long refinement = 1) {
  const Sample reference = samples_of(scene, {.method = testing::gl(6), .step = 3.6 / 96}, 96).back();
  const long coarse = refinement * (s == 1 ? 240 : s == 2 ? 40 : s == 3 ? 16 : 8);
  const double first = error_with(scene, testing::gl(s), coarse, reference);
  const double second = error_with(scene, testing::gl(s), 2 * coarse, reference);
  EXPECT_GT(second, 1e-13) << scene->name << ": at round-off, nothing is measured";
  EXPECT_NEAR(std::log2(first / second), 2.0 * s, 0.35)
      << scene->name << " s = " << s << " errors " << first << " " << second;
}

TEST(GaussLobattoStep, OrderIsTwiceTheStagesInConfigurationVelocityAndMultipliers) {
  for (const auto& plain : testing::every_constraint_class())
    for (const auto& scene : {plain, testing::forced(plain)})
      for (const int s : {1, 2, 3, 4}) expect_order(scene, s);
}

TEST(GaussLobattoStep, OrderHoldsForAffineAndTimeDependentRows) {
  for (const int s : {1, 2, 3, 4}) expect_order(testing::driven(), s, 2);
}

TEST(GaussLobattoStep, IsSelfAdjoint) {
  for (const auto& scene : testing::every_constraint_class())
    for (const int s : {1, 2, 3, 4}) {
      const auto there = samples_of(scene, {.method = testing::gl(s), .step = 0.1}, 1).back();
      auto back = std::make_shared<Scene>(*scene);
      back->start = {0.0, there.q, there.v};
      const auto again = samples_of(back, {.method = testing::gl(s), .step = -0.1}, 1).back();
      EXPECT_LT((again.q - scene->start.q).lpNorm<Eigen::Infinity>(), 1e-13) << scene->name;
      EXPECT_LT((again.v - scene->start.v).lpNorm<Eigen::Infinity>(), 1e-13) << scene->name;
    }
}

TEST(GaussLobattoStep, TheThreeTypesAreOneSystem) {
  const auto scene = testing::mixed();
  const auto one = samples_of(scene, {.method = "type1/gl:3", .step = 0.1}, 10).back();
  for (const char* name : {"type2/gl:3", "type3/gl:3"})
    EXPECT_EQ(samples_of(scene, {.method = name, .step = 0.1}, 10).back().q, one.q);
}

TEST(GaussLobattoStep, HolonomicRowsDoNotDrift) {
  const auto scene = testing::mixed();
  const auto samples = samples_of(scene, {.method = testing::gl(3), .step = 0.1}, 400);
  Vector phi(1);
  scene->constraints.front()->position(0.0, samples.back().q, phi);
  EXPECT_LT(std::abs(phi[0]), 1e-14);
}

TEST(GaussLobattoStep, FullAndSparseMatricesAgree) {
  for (const auto& scene : testing::every_constraint_class()) {
    const auto full = samples_of(scene, {.method = testing::gl(3), .step = 0.1}, 20).back();
    const auto sparse =
        samples_of(scene, {.method = testing::gl(3), .step = 0.1, .dense_limit = 0}, 20).back();
    EXPECT_LT((full.q - sparse.q).lpNorm<Eigen::Infinity>(), 1e-12) << scene->name;
  }
}

}  // namespace
}  // namespace diracstep
