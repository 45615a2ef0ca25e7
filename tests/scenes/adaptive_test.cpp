#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/studies/study_run.hpp>
#include <iostream>

namespace diracstep {
namespace {

/// Largest energy error in the first and in the last fifth of a run.
struct Fifths {
  double first = 0.0, last = 0.0;
  long resets = 0;
};

Fifths energy_errors(const std::string& name, const std::string& method, double eps, StepControl control,
                     double end) {
  const auto scene = make_scene(name).scene;
  AdaptiveIntegrator integrator(scene, Registry::with_built_ins(), kinsol(), {.method = method, .step = 0.1},
                                {.eps = eps, .control = control, .end = end});
  const double energy = scene->energy(0.0, scene->start.q, scene->start.v);
  Fifths found;
  const RunReport report = run_until(integrator, end, Momentum::projected, 1, [&](const Sample& sample) {
    const double error = std::abs(sample.energy - energy);
    if (sample.time < 0.2 * end) found.first = std::max(found.first, error);
    if (sample.time > 0.8 * end) found.last = std::max(found.last, error);
    return error < 1.0;
  });
  EXPECT_TRUE(report.ok()) << report.last.failure;
  found.resets = integrator.control().resets;
  return found;
}

TEST(AdaptiveSteps, EnergyOfAThousandEccentricOrbitsDoesNotDrift_slow) {
  const double end = 2000.0 * std::acos(-1.0);
  for (const StepControl control : {StepControl::integrating, StepControl::in_step}) {
    const Fifths found = energy_errors("kepler_e099", "type1/gl:3", 0.3, control, end);
    EXPECT_LT(found.last, 1.1 * found.first);
    EXPECT_LT(found.last, 1e-4);
    EXPECT_EQ(found.resets, 0);
  }
  const Fifths drifting = energy_errors("kepler_e099", "type1/gl:3", 0.3, StepControl::irreversible, end);
  EXPECT_GT(drifting.last, 3.0 * drifting.first);
}

TEST(AdaptiveSteps, EnergyOfTheContactOscillatorDoesNotDrift_slow) {
  const double end = 6283.185307179586;
  for (const StepControl control : {StepControl::integrating, StepControl::in_step}) {
    const Fifths found = energy_errors("contact_oscillator", "type1/gl:2", 0.3, control, end);
    EXPECT_LT(found.last, 1.1 * found.first);
    EXPECT_LT(found.last, 1e-4);
    EXPECT_EQ(found.resets, 0);
  }
  const Fifths drifting =
      energy_errors("contact_oscillator", "type1/gl:2", 0.3, StepControl::irreversible, end);
  EXPECT_GT(drifting.last, 3.0 * drifting.first);
}

/// Runs of solve_to_error on the scenes with a reference and at most 15 unknowns, for errors that the
/// reference can judge: how many keep their word.
struct Tally {
  int runs = 0, met = 0, misleading = 0;
};

void examine(const std::string& name, Tally& tally) {
  const CatalogueScene scene = make_scene(name);
  if (!scene.needs.empty() || !scene.events.empty()) return;
  if (scene.scene->dimension() + scene.scene->rows() > 15) return;
  if (!scene.reference.at || !scene.reference.at(scene.t_end)) return;
  const ReferenceEnd reference = reference_end(scene, scene.t_end);
  for (double error = 1e-3; error > 0.9e-11; error /= 10.0) {
    if (error < reference.self_error) continue;
    const ErrorControlReport report =
        solve_to_error(scene.scene, Registry::with_built_ins(), kinsol(), scene.t_end, {.error = error});
    const double found = reference.distance(report.end);
    ++tally.runs;
    if (report.ok() && found <= error) ++tally.met;
    if (!report.ok()) std::cout << name << ": " << report.refusal << '\n';
    const bool misled = report.ok() && found > 5.0 * error && report.warning.empty();
    if (misled) ++tally.misleading;
    EXPECT_FALSE(misled) << name << ": " << error << " asked for, " << found << " found, estimate "
                         << report.estimate;
  }
}

/// Steps that have to be followed from short ones are given up after a few, and no run is taken twice.
TEST(ErrorControl, ASearchSolvesLittleMoreThanItsRuns) {
  for (const auto& [name, error] :
       {std::pair{"pendulum_cartesian", 1e-9}, {"ball_turntable", 1e-6}, {"contact_oscillator", 1e-6}}) {
    const CatalogueScene scene = make_scene(name);
    const ErrorControlReport report =
        solve_to_error(scene.scene, Registry::with_built_ins(), kinsol(), scene.t_end, {.error = error});
    ASSERT_TRUE(report.ok()) << name << ": " << report.refusal;
    EXPECT_LE(report.work.solves, 6 * report.runs.back().solves) << name;
    EXPECT_LT(reference_end(scene, scene.t_end).distance(report.end), error) << name;
  }
}

TEST(ErrorControl, StepsThatAreTooLongAreGivenUp) {
  const CatalogueScene scene = make_scene("pendulum_cartesian");
  const ErrorControlReport report = solve_to_error(scene.scene, Registry::with_built_ins(), kinsol(),
                                                   scene.t_end, {.error = 1e-6, .first_step = 0.33});
  ASSERT_TRUE(report.ok()) << report.refusal;
  EXPECT_NE(report.runs.front().failure.find("given up"), std::string::npos) << report.runs.front().failure;
  EXPECT_LT(report.runs.front().solves, 300);
}

TEST(ErrorControl, ExplicitStepsDoNotVary) {
  const CatalogueScene scene = make_scene("toda_200");
  const ErrorControlReport report =
      solve_to_error(scene.scene, Registry::with_built_ins(), kinsol(), scene.t_end, {.error = 1e-6});
  ASSERT_TRUE(report.ok()) << report.refusal;
  EXPECT_FALSE(report.adaptive) << "a variable step reads accelerations, and takes 25 times as long";
}

TEST(ErrorControl, KeepsItsWordOverTheCatalogue_slow) {
  Tally tally;
  for (const std::string& name : scene_names()) examine(name, tally);
  EXPECT_GT(tally.runs, 100);
  EXPECT_GE(tally.met, 0.95 * tally.runs);
  EXPECT_EQ(tally.misleading, 0);
}

}  // namespace
}  // namespace diracstep
