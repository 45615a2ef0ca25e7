#include <gtest/gtest.h>

#include <diracstep/core/runs/run.hpp>
#include <limits>

#include "combinations.hpp"
#include "misuse.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::expect_misuse;
using testing::integrator_for;

const double nan = std::numeric_limits<double>::quiet_NaN();
const double infinity = std::numeric_limits<double>::infinity();

// --- Step sizes
// -------------------------------------------------------------------------------------------------

void expect_grid(double start, double end, double step, long count, double size) {
  const StepGrid grid = fit_steps(start, end, step);
  EXPECT_EQ(grid.steps, count) << start << " " << end << " " << step;
  EXPECT_EQ(grid.step, size) << start << " " << end << " " << step;
}

TEST(FitSteps, StepsThatDivideTheIntervalAreKept) {
  expect_grid(0.0, 1.0, 0.125, 8, 0.125);
  expect_grid(2.0, 1.0, -0.25, 4, -0.25);
  expect_grid(0.0, 29.7, 0.05, 594, 29.7 / 594.0);
  expect_grid(0.0, 3.0 * 0.1, 0.1, 3, 3.0 * 0.1 / 3.0);
}

TEST(FitSteps, OtherStepsBecomeSmallerUntilTheyFit) {
  expect_grid(0.0, 1.0, 0.3, 4, 0.25);
  expect_grid(0.0, 1.0, 0.9, 2, 0.5);
  expect_grid(1.0, -1.0, -0.75, 3, -2.0 / 3.0);
  expect_grid(0.0, 1.0, 7.0, 1, 1.0);
}

TEST(FitSteps, StepsThatLeadNowhereAreRefusedWithTheirSize) {
  expect_misuse([] { (void)fit_steps(0.0, 1.0, 0.0); }, {"step size is 0"});
  expect_misuse([] { (void)fit_steps(0.0, 1.0, nan); }, {"step size is nan"});
  expect_misuse([] { (void)fit_steps(0.0, 1.0, -infinity); }, {"step size is -inf"});
  expect_misuse([] { (void)fit_steps(0.0, 1.0, -0.5); }, {"size -0.5", "t = 0", "t = 1"});
  expect_misuse([] { (void)fit_steps(3.0, 1.0, 0.5); }, {"size 0.5", "t = 3", "t = 1"});
  expect_misuse([] { (void)fit_steps(2.0, 2.0, 0.5); }, {"size 0.5", "t = 2"});
  expect_misuse([] { (void)fit_steps(0.0, nan, 0.5); }, {"size 0.5", "t = nan"});
}

TEST(FitSteps, TooSmallStepsAreRefusedWithTheirSize) {
  expect_misuse([] { (void)fit_steps(0.0, 1.0, 1e-20); }, {"too small", "1e-20"});
  expect_misuse([] { (void)fit_steps(0.0, 1.0, 5e-324); }, {"4.94066e-324"});
}

// --- Runs
// -------------------------------------------------------------------------------------------------------

TEST(Run, ShowsTheStartEveryKthPointAndTheLast) {
  const auto times_of = [](long steps, long every) {
    Integrator integrator = integrator_for(testing::nonholonomic(), {.step = 0.125});
    std::vector<double> times;
    EXPECT_TRUE(run_steps(integrator, steps, Momentum::plus, every, [&](const Sample& sample) {
                  times.push_back(sample.time / 0.125);
                  return true;
                }).ok());
    EXPECT_EQ(integrator.work().steps, steps);
    return times;
  };
  EXPECT_EQ(times_of(5, 2), (std::vector<double>{0, 2, 4, 5}));
  EXPECT_EQ(times_of(4, 2), (std::vector<double>{0, 2, 4}));
  EXPECT_EQ(times_of(3, 10), (std::vector<double>{0, 3}));
  EXPECT_EQ(times_of(0, 1), (std::vector<double>{0}));
}

TEST(Run, EndsWhereTheObserverSaysSo) {
  Integrator integrator = integrator_for(testing::nonholonomic(), {.step = 0.125});
  int shown = 0;
  EXPECT_TRUE(run_steps(integrator, 10, Momentum::plus, 1, [&](const Sample&) { return ++shown < 4; }).ok());
  EXPECT_EQ(shown, 4);
  EXPECT_EQ(integrator.work().steps, 3);
}

TEST(Run, KeepingLessThanEveryPointIsRefusedBeforeAnythingIsDone) {
  Integrator integrator = integrator_for(testing::nonholonomic(), {.step = 0.125});
  for (const long every : {0L, -3L})
    expect_misuse(
        [&] {
          (void)run_steps(integrator, 2, Momentum::plus, every, [](const Sample&) {
            ADD_FAILURE() << "a point was shown";
            return true;
          });
        },
        {"every = " + std::to_string(every), "1 or more"});
  EXPECT_EQ(integrator.work().steps, 0);
}

/// The doubts of 40 steps of one coordinate, whose bits they leave alone.
template <class Formula>
std::string doubts_of(Formula formula, const char* method, double step) {
  Scene scene;
  scene.name = "one coordinate";
  scene.coordinates = {"q"};
  scene.lagrangian = lagrangian<1>(formula);
  scene.start = {0.0, Vector{{1.0}}, Vector{{6.0}}};
  const auto shared = std::make_shared<const Scene>(scene);
  const IntegratorOptions options{.method = method, .step = step};
  Integrator watched = integrator_for(shared, options), alone = integrator_for(shared, options);
  RunChecks doubt(watched, 40);
  EXPECT_TRUE(run_steps(watched, 40, Momentum::projected, 10, nullptr, &doubt).ok());
  EXPECT_TRUE(run_steps(alone, 40, Momentum::projected, 10, nullptr).ok());
  EXPECT_EQ(watched.position(), alone.position());
  EXPECT_EQ(watched.work().solves, alone.work().solves);
  return doubt.text();
}

TEST(Run, SaysWhyItsResultIsNotToBeBelieved) {
  const auto pendulum = [](const auto& q, const auto& v) {
    using std::cos;
    return 0.5 * v[0] * v[0] + 10.0 * cos(q[0]);
  };
  EXPECT_EQ(doubts_of(pendulum, "type1/trapezoidal", 0.003), "");
  EXPECT_NE(doubts_of(pendulum, "type1/trapezoidal", 1.5).find("this scene keeps, went from 12.597 to"),
            std::string::npos);
  const auto driven = [](const auto& q, const auto& v, const auto& t) {
    using std::cos;
    return 0.5 * (v[0] * v[0] - q[0] * q[0]) + 200.0 * q[0] * cos(20.0 * t);
  };
  EXPECT_EQ(doubts_of(driven, "type1/midpoint", 0.003), "");
  EXPECT_TRUE(doubts_of(driven, "type1/midpoint", 0.25).starts_with("step size check: from t ="));
}

/// The same integrator for a second run, from another start: the doubt is of that run alone.
TEST(Run, DoubtsBeginWhereTheRunDoes) {
  Integrator integrator = integrator_for(testing::unconstrained(), {.method = "type1/gl:2", .step = 0.05});
  EXPECT_TRUE(run_steps(integrator, 20, Momentum::projected, 1, nullptr).ok());
  Start start = integrator.scene().start;
  start.v *= 10.0;
  integrator.reset(start);
  for (int k = 0; k < 2; ++k) {
    RunChecks doubt(integrator, 20);
    EXPECT_TRUE(run_steps(integrator, 20, Momentum::projected, 1, nullptr, &doubt).ok());
    EXPECT_EQ(doubt.text(), "");
  }
}

}  // namespace
}  // namespace diracstep
