#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/validation/references/explicit_reference.hpp>
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

TEST(ExplicitReference, RefusesOptionsOutOfRange) {
  const CatalogueScene entry = make_scene("kepler_e06");
  expect_misuse([&] { (void)integrate_explicitly(*entry.scene, -1.0, {}); }, {"ARKODE", "t_end = -1"});
  expect_misuse([&] { (void)integrate_explicitly(*entry.scene, 1.0, {.rtol = 1e-16}); }, {"rtol = 1e-16"});
}

}  // namespace
}  // namespace diracstep
