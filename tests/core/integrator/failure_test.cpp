#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <limits>
#include <sstream>

#include "combinations.hpp"
#include "misuse.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::expect_parts;
using testing::integrator_for;
using testing::ScenePointer;

// --- Failure
// ----------------------------------------------------------------------------------------------------

/// A free particle on a circle of radius √(1 − t), which is gone after t = 1.
ScenePointer vanishing_circle() {
  Scene scene;
  scene.name = "vanishing circle";
  scene.coordinates = {"x", "y"};
  scene.lagrangian =
      lagrangian<2>([](const auto&, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]); });
  scene.constraints = {holonomic<2, 1>(
      []<class T>(const std::array<T, 2>& q, const T& t) {
        return std::array<T, 1>{q[0] * q[0] + q[1] * q[1] - 1.0 + t};
      },
      {"circle"})};
  scene.start = {0.0, Vector{{1.0, 0.0}}, Vector{{-0.5, 0.3}}};
  return std::make_shared<const Scene>(scene);
}

/// An oscillator whose potential is not a number after t = 1.
ScenePointer expiring_oscillator() {
  Scene scene;
  scene.name = "expiring oscillator";
  scene.coordinates = {"x"};
  scene.lagrangian = lagrangian<1>([](const auto& q, const auto& v, const auto& t) {
    using std::sqrt;
    return 0.5 * v[0] * v[0] - 0.5 * q[0] * q[0] * sqrt(1.0 - t);
  });
  scene.start = {0.0, Vector::Constant(1, 1.0), Vector::Constant(1, 0.5)};
  return std::make_shared<const Scene>(scene);
}

/// Steps until one fails, which must be step number `step`, and checks that this one left no trace.
StepReport failing_step(Integrator& integrator, long step) {
  for (long k = 0; k < step; ++k) EXPECT_TRUE(integrator.step().ok()) << "step " << k;
  Sample before, after;
  EXPECT_TRUE(integrator.sample(Momentum::plus, before).ok());
  StepReport report = integrator.step();
  EXPECT_FALSE(report.ok());
  EXPECT_EQ(report.step, step);
  EXPECT_EQ(report.time, before.time);
  EXPECT_EQ(integrator.position(), before.q);
  EXPECT_EQ(integrator.time(), before.time);
  EXPECT_EQ(integrator.work().steps, step);
  EXPECT_TRUE(integrator.sample(Momentum::plus, after).ok());
  EXPECT_EQ(after.p, before.p);
  EXPECT_LT(testing::distance(after.v, before.v), 1e-14);
  return report;
}

TEST(Failure, StepWithoutASolutionNamesStepTimeAndResiduals) {
  Integrator integrator = integrator_for(vanishing_circle(), {.method = "type1/midpoint", .step = 0.4});
  const StepReport report = failing_step(integrator, 2);
  EXPECT_GT(report.solve.residual_norms[1], 0.2 - 1e-9);  // φ = x² + y² + 0.2 at the end of the step
  std::ostringstream residuals;
  residuals << "momentum residual " << report.solve.residual_norms[0] << ", constraint residual "
            << report.solve.residual_norms[1];
  expect_parts(report.failure,
               {"step 2", "t = 0.8", diracstep::describe(report.solve.status), residuals.str()});
}

TEST(Failure, StepThatDoesNotConvergeIsReported) {
  Integrator integrator(testing::mixed(), Registry::with_built_ins(), kinsol({.max_iterations = 1}),
                        {.method = "type1/midpoint", .step = 0.5});
  const StepReport report = failing_step(integrator, 0);
  EXPECT_EQ(report.solve.status, SolveStatus::no_convergence);
  EXPECT_GT(report.solve.residual_norms[0] + report.solve.residual_norms[1], 1e-6);
  expect_parts(report.failure, {"step 0", "t = 0:", "no convergence"});
}

TEST(Failure, FailedStepCanBeRepeatedAndFailsAgain) {
  Integrator integrator = integrator_for(vanishing_circle(), {.method = "type1/midpoint", .step = 0.4});
  const StepReport first = failing_step(integrator, 2), again = integrator.step();
  EXPECT_FALSE(again.ok());
  EXPECT_EQ(again.step, 2);
  EXPECT_EQ(again.time, first.time);
}

TEST(Failure, LaterStageLeavesTheMinusMomentumAsItWas) {
  // From t = 0.8 the first stages of order 6 end at 0.957 and at 1.090: the second one fails.
  Integrator integrator =
      integrator_for(vanishing_circle(), {.method = "type1/trapezoidal", .order = 6, .step = 0.4});
  for (int k = 0; k < 2; ++k) ASSERT_TRUE(integrator.step().ok());
  Sample before, after;
  ASSERT_TRUE(integrator.sample(Momentum::minus, before).ok());
  ASSERT_FALSE(integrator.step().ok());
  ASSERT_TRUE(integrator.sample(Momentum::minus, after).ok());
  EXPECT_EQ(after.q, before.q);
  EXPECT_LT(testing::distance(after.p, before.p), 1e-13);
}

TEST(Failure, LagrangianThatIsNotANumberIsReported) {
  Integrator integrator = integrator_for(expiring_oscillator(), {.method = "type1/midpoint", .step = 0.3});
  const StepReport report = failing_step(integrator, 3);
  EXPECT_EQ(report.solve.status, SolveStatus::not_finite);
  EXPECT_TRUE(std::isnan(report.solve.residual_norms[0]));
  expect_parts(report.failure, {"step 3", "t = 0.9:", "not finite", "momentum residual nan"});
}

TEST(Failure, ExplicitStepOutOfTheDomainIsReported) {
  Integrator integrator =
      integrator_for(testing::edge_of_the_domain(), {.method = "type1/trapezoidal", .step = 0.1});
  const StepReport report = failing_step(integrator, 2);
  EXPECT_EQ(report.solve.status, SolveStatus::not_finite);
  expect_parts(report.failure, {"step 2", "t = 0.2", "not finite"});
}

TEST(Failure, SingularJacobianIsReported) {
  // D1D2 L_d = -1/h + h/4 vanishes at h = 2.
  Scene scene;
  scene.name = "saddle";
  scene.coordinates = {"x"};
  scene.lagrangian =
      lagrangian<1>([](const auto& q, const auto& v) { return 0.5 * (v[0] * v[0] + q[0] * q[0]); });
  scene.start = {0.0, Vector{{1.0}}, Vector{{0.5}}};
  Integrator integrator =
      integrator_for(std::make_shared<const Scene>(scene), {.method = "type1/midpoint", .step = 2.0});
  const StepReport report = integrator.step();
  EXPECT_EQ(report.solve.status, SolveStatus::singular_jacobian);
  expect_parts(report.failure, {"step 0", "t = 0", "singular"});
}

TEST(Failure, RunKeepsWhatWasObservedBefore) {
  Integrator integrator = integrator_for(vanishing_circle(), {.method = "type1/midpoint", .step = 0.4});
  std::vector<double> times;
  const RunReport report = run_steps(integrator, 10, Momentum::projected, 1, [&](const Sample& sample) {
    times.push_back(sample.time);
    return true;
  });
  EXPECT_FALSE(report.ok());
  EXPECT_EQ(times, (std::vector<double>{0.0, 0.4, 0.8}));
  EXPECT_EQ(report.last.step, 2);
  EXPECT_FALSE(report.last.failure.empty());
}

TEST(Failure, StateThatCannotBeReadIsReportedByRun) {
  // The third step is evaluated at its middle, t = 0.9375, and succeeds; its end is beyond t = 1.
  Integrator integrator = integrator_for(expiring_oscillator(), {.method = "type1/midpoint", .step = 0.375});
  std::vector<double> times;
  const RunReport report = run_steps(integrator, 3, Momentum::projected, 1, [&](const Sample& sample) {
    times.push_back(sample.time);
    return true;
  });
  EXPECT_FALSE(report.ok());
  EXPECT_EQ(report.last.solve.status, SolveStatus::not_finite);
  EXPECT_EQ(times, (std::vector<double>{0.0, 0.375, 0.75}));
  expect_parts(report.last.failure, {"t = 1.125", "not finite"});
}

}  // namespace
}  // namespace diracstep
