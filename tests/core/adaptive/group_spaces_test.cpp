#include <gtest/gtest.h>

#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "group_scenes.hpp"
#include "methods.hpp"

/// Variable steps, errors asked for and the checks of a run on groups and spheres.
namespace diracstep {
namespace {

using group_scenes::GroupScene;

class OnGroups : public ::testing::TestWithParam<GroupScene> {
 protected:
  double error_of(const Sample& end) const {
    return (GetParam().observe(end.q, end.v) - group_scenes::reference(GetParam(), 2.0))
        .lpNorm<Eigen::Infinity>();
  }
};

TEST_P(OnGroups, VariableStepsConvergeWithTheOrderOfTheirMethod) {
  std::array<double, 2> errors{};
  for (const int k : {0, 1}) {
    AdaptiveOptions adaptive;
    adaptive.eps = k == 0 ? 0.2 : 0.1;
    AdaptiveIntegrator integrator(GetParam().scene, Registry::with_built_ins(), kinsol(),
                                  {.method = testing::gl(2), .step = 0.05}, adaptive);
    Sample end;
    const RunReport report = run_until(integrator, 2.0, Momentum::projected, 1, [&](const Sample& s) {
      end = s;
      return true;
    });
    ASSERT_TRUE(report.ok()) << report.last.failure;
    errors[static_cast<std::size_t>(k)] = error_of(end);
  }
  EXPECT_LT(errors[1], 2e-4);
  EXPECT_NEAR(std::log2(errors[0] / errors[1]), 4.0, 0.8) << errors[0] << " " << errors[1];
}

TEST_P(OnGroups, TheErrorAskedForIsReached) {
  ErrorControlOptions asked;
  // Runs of different steps turn the frame of a sphere differently, by what falls with h²: they agree late.
  asked.error = GetParam().scene->space->turns().empty() ? 1e-7 : 1e-4;
  const ErrorControlReport report =
      solve_to_error(GetParam().scene, Registry::with_built_ins(), kinsol(), 2.0, asked);
  ASSERT_TRUE(report.ok()) << report.refusal;
  EXPECT_LT(error_of(report.end), asked.error);
}

TEST_P(OnGroups, RunsPassTheirChecks) {
  Integrator integrator(GetParam().scene, Registry::with_built_ins(), kinsol(),
                        {.method = testing::gl(2), .step = 0.05});
  RunChecks checks(integrator, 400);
  const RunReport report = run_steps(
      integrator, 400, Momentum::projected, 1, [](const Sample&) { return true; }, &checks);
  ASSERT_TRUE(report.ok()) << report.last.failure;
  EXPECT_EQ(checks.text(), "");
}

/// Errors near round-off are looked for without compensated sums, which steps on groups do not have.
TEST(OnGroupsToo, ErrorsNearRoundOffAreReached) {
  const auto top = group_scenes::heavy_top();
  ErrorControlOptions asked;
  asked.error = 1e-12;
  const ErrorControlReport report =
      solve_to_error(top.scene, Registry::with_built_ins(), kinsol(), 0.5, asked);
  ASSERT_TRUE(report.ok()) << report.refusal;
  EXPECT_FALSE(report.compensated_sums);
  EXPECT_LT(report.estimate, asked.error);
}

/// A step far too large is told, as in R^n.
TEST(OnGroupsToo, LargeStepsAreDoubted) {
  Integrator integrator(group_scenes::heavy_top().scene, Registry::with_built_ins(), kinsol(),
                        {.method = testing::gl(1), .step = 1.2});
  RunChecks checks(integrator, 40);
  const RunReport report = run_steps(
      integrator, 40, Momentum::projected, 1, [](const Sample&) { return true; }, &checks);
  EXPECT_TRUE(!report.ok() || !checks.text().empty());
}

INSTANTIATE_TEST_SUITE_P(Scenes, OnGroups, ::testing::ValuesIn(group_scenes::all_scenes()),
                         [](const auto& of) { return testing::test_name(of.param.name); });

}  // namespace
}  // namespace diracstep
