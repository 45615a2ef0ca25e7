#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/validation/references/explicit_reference.hpp>
#include <diracstep/validation/references/odeint_steps.hpp>
#include <diracstep/validation/studies/study_run.hpp>
#include <diracstep/validation/studies/work_precision.hpp>

#include "misuse.hpp"

namespace diracstep {
namespace {

using testing::expect_misuse;

double error_at(const std::string& name, double rtol, double* constraint = nullptr) {
  const CatalogueScene entry = make_scene(name);
  const ReferenceEnd reference = reference_end(entry, entry.t_end);
  Sample end;
  const StudyRow row =
      run_baseline(erk_method, *completed(entry.scene), entry.t_end, {.rtol = rtol}, 1, reference, end);
  EXPECT_TRUE(row.ok()) << row.status;
  if (constraint != nullptr) *constraint = row.constraint;
  return row.error();
}

TEST(ExplicitReference, MeetsClosedForms) {
  for (const char* name : {"knife_edge", "pendulum_cartesian", "nonholonomic_particle_free", "kepler_e06"})
    EXPECT_LT(error_at(name, 1e-13), 1e-8) << name;
}

TEST(ExplicitReference, ErrorFallsWithTheTolerance) {
  const double coarse = error_at("knife_edge", 1e-6), fine = error_at("knife_edge", 1e-10);
  EXPECT_GT(coarse, 1e-10);
  EXPECT_LT(fine, 1e-3 * coarse);
}

/// The rows enter only differentiated, so nothing holds the solution on them.
TEST(ExplicitReference, DriftsOffHolonomicRows) {
  double constraint = 0.0;
  (void)error_at("pendulum_cartesian", 1e-6, &constraint);
  EXPECT_GT(constraint, 1e-9);
}

/// Lotka–Volterra as a phase-space Lagrangian: y = q alone, and the energy is kept to the tolerance.
TEST(ExplicitReference, TakesTheVelocityOfAPhaseSpaceLagrangian) {
  const CatalogueScene entry = make_scene("lotka_volterra_2d");
  EXPECT_EQ(ReducedEquations(*entry.scene, true).size(), entry.scene->dimension());
  const ReferenceRun run = integrate_explicitly(*entry.scene, 5.0, {.rtol = 1e-12});
  ASSERT_TRUE(run.ok()) << run.failure;
  const Start& start = entry.scene->start;
  EXPECT_NEAR(run.end.energy, entry.scene->energy(start.time, start.q, start.v), 1e-11);
  EXPECT_GT((run.end.q - start.q).norm(), 0.1);
}

TEST(ExplicitReference, StopsAtTheStepLimitAndSaysWhere) {
  const CatalogueScene entry = make_scene("kepler_e06");
  const ReferenceRun run = integrate_explicitly(*entry.scene, 200.0, {.rtol = 1e-10, .max_steps = 10});
  EXPECT_NE(run.failure.find("ARK_TOO_MUCH_WORK at t = "), std::string::npos) << run.failure;
  EXPECT_EQ(run.steps, 10);
  EXPECT_LT(run.end.time, 200.0);
}

/// What sized_equations() takes, with the same rates as equations of any size, at the start and off it.
TEST(ExplicitReference, EquationsOfKnownSizeAreThoseOfAnySize) {
  int taken = 0, with_rows = 0, coupled = 0;
  for (const std::string& name : scene_names()) {
    const CatalogueScene entry = make_scene(name);
    if (!entry.needs.empty() || !entry.scene->lagrangian) continue;
    const auto sized = sized_equations(*entry.scene);
    if (!sized) continue;
    const Scene& scene = *entry.scene;
    const Eigen::Index n = scene.dimension();
    ++taken;
    with_rows += scene.rows() > 0 ? 1 : 0;
    coupled += scene.lagrangian->structure().separable ? 0 : 1;
    ReducedEquations general(scene, true);
    ASSERT_EQ(sized->size(), general.size()) << name;
    Vector y(2 * n), expected(2 * n), rate(2 * n);
    for (const double off : {0.0, 0.01, 0.02}) {
      for (Eigen::Index i = 0; i < n; ++i) {
        y[i] = scene.start.q[i] + off * static_cast<double>(1 + i % 3);
        y[n + i] = scene.start.v[i] - off * static_cast<double>(1 + i % 2);
      }
      if (!general.rate(0.0, y, expected) || !expected.allFinite()) continue;
      ASSERT_TRUE(sized->rate(y.data(), rate.data())) << name;
      const double size = std::max(1.0, expected.lpNorm<Eigen::Infinity>());
      EXPECT_LT((rate - expected).lpNorm<Eigen::Infinity>(), 1e-12 * size) << name << ", off by " << off;
    }
  }
  EXPECT_GT(taken, 10);
  EXPECT_GT(with_rows, 4);
  EXPECT_GT(coupled, 1);
}

TEST(ExplicitReference, BoostMeetsClosedForms) {
  if (!has_odeint()) GTEST_SKIP() << "built without Boost.odeint";
  for (const char* name : {"knife_edge", "pendulum_cartesian", "nonholonomic_particle_free", "kepler_e06"}) {
    const CatalogueScene entry = make_scene(name);
    const ReferenceEnd reference = reference_end(entry, entry.t_end);
    const std::vector<ExplicitCode> codes = explicit_codes(*entry.scene);
    ASSERT_EQ(codes.size(), 3u) << name;
    for (const ExplicitCode code : codes) {
      const ReferenceRun coarse = integrate_explicitly(*entry.scene, entry.t_end, {.rtol = 1e-6}, code);
      const ReferenceRun fine = integrate_explicitly(*entry.scene, entry.t_end, {.rtol = 1e-12}, code);
      ASSERT_TRUE(fine.ok()) << fine.failure;
      EXPECT_DOUBLE_EQ(fine.end.time, entry.t_end);
      EXPECT_LT(reference.distance(fine.end), 1e-7) << name << ", " << diracstep::name(code);
      EXPECT_GT(reference.distance(coarse.end), reference.distance(fine.end));
      EXPECT_GT(fine.steps, coarse.steps);
      EXPECT_GT(fine.residual_evaluations, 5 * fine.steps);
    }
  }
}

TEST(ExplicitReference, BoostStopsAtTheStepLimitAndTakesSmallScenesAlone) {
  if (!has_odeint()) GTEST_SKIP() << "built without Boost.odeint";
  for (const ExplicitCode code : {ExplicitCode::fehlberg78, ExplicitCode::bulirsch_stoer}) {
    const CatalogueScene kepler = make_scene("kepler_e06"), toda = make_scene("toda_200");
    const ReferenceRun run =
        integrate_explicitly(*kepler.scene, 200.0, {.rtol = 1e-10, .max_steps = 10}, code);
    EXPECT_NE(run.failure.find("the step limit is reached at t = "), std::string::npos) << run.failure;
    EXPECT_EQ(run.steps, 10);
    EXPECT_LT(run.end.time, 200.0);
    EXPECT_EQ(explicit_codes(*toda.scene), std::vector<ExplicitCode>{ExplicitCode::arkode});
    expect_misuse([&] { (void)integrate_explicitly(*toda.scene, 1.0, {}, code); },
                  {"odeint-", "does not take", "toda_200"});
  }
}

TEST(ExplicitReference, RefusesOptionsOutOfRange) {
  const CatalogueScene entry = make_scene("kepler_e06");
  expect_misuse([&] { (void)integrate_explicitly(*entry.scene, -1.0, {}); }, {"ARKODE", "t_end = -1"});
  expect_misuse([&] { (void)integrate_explicitly(*entry.scene, 1.0, {.rtol = 1e-16}); }, {"rtol = 1e-16"});
}

}  // namespace
}  // namespace diracstep
