#include <diracstep/scene_format/parametric_scene_file.hpp>
#include <diracstep/sensitivities/fit.hpp>
#include <random>

#include "derivatives.hpp"

namespace diracstep {
namespace {

using namespace testing;

const std::vector<std::string>& fitted() {
  static const std::vector<std::string> names{"a", "J"};
  return names;
}

FitProblem sleigh_problem(const Registry& registry) {
  return {[](const Vector& values) {
            const Parameters changes{{"a", values[0]}, {"J", values[1]}};
            return parametric_scene("chaplygin_sleigh", make_scene("chaplygin_sleigh", changes), fitted(),
                                    changes);
          },
          registry,
          kinsol(),
          {.method = "type1/gl:2", .step = 0.1}};
}

constexpr double noise = 0.01;

/// Positions and the rate of the heading of the sleigh with a = 0.2, J = 0.1, and noise; some are missing.
FitData measured(unsigned seed) {
  const CatalogueScene entry = make_scene("chaplygin_sleigh");
  const std::vector<Sample> motion = samples_of(entry.scene, {.method = "type1/gl:4", .step = 0.1}, 40);
  std::mt19937 random(seed);
  std::normal_distribution<double> error(0.0, noise);
  FitData data{{{0}, {1}, {2, true, 2.0}}, Vector(20), Columns(20, 3)};
  for (int k = 0; k < 20; ++k) {
    const Sample& point = motion[static_cast<std::size_t>(2 * k + 2)];
    data.times[k] = point.time;
    data.values.row(k) << point.q[0] + error(random), point.q[1] + error(random),
        point.v[2] + 2.0 * error(random);
  }
  data.values(3, 1) = data.values(7, 2) = std::nan("");
  return data;
}

/// How often each interval holds the planted value.
std::array<int, 2> hits(int trials) {
  const Registry registry = Registry::with_built_ins();
  const FitProblem problem = sleigh_problem(registry);
  const Vector planted{{0.2, 0.1}};
  std::array<int, 2> count{};
  for (int trial = 0; trial < trials; ++trial) {
    const FitReport report = fit(problem, measured(static_cast<unsigned>(trial)), Vector{{0.3, 0.2}});
    EXPECT_TRUE(report.converged) << report.ending;
    EXPECT_EQ(report.measured, 58);
    EXPECT_NEAR(report.residual, noise, 0.35 * noise);
    for (int k = 0; k < 2; ++k)
      if (std::abs(report.parameters[k] - planted[k]) <= report.interval[k])
        ++count[static_cast<std::size_t>(k)];
    EXPECT_LT(report.interval[0], 0.02);
  }
  return count;
}

TEST(Fit, FindsPlantedParametersToRoundOffWithoutNoise) {
  const Registry registry = Registry::with_built_ins();
  const FitProblem problem = sleigh_problem(registry);
  FitData data = measured(0);
  const CatalogueScene entry = make_scene("chaplygin_sleigh");
  const std::vector<Sample> motion = samples_of(entry.scene, problem.steps, 40);
  for (int k = 0; k < 20; ++k) {
    const Sample& point = motion[static_cast<std::size_t>(2 * k + 2)];
    data.values.row(k) << point.q[0], point.q[1], point.v[2];
  }
  const FitReport report = fit(problem, data, Vector{{0.35, 0.3}});
  EXPECT_TRUE(report.converged);
  EXPECT_NEAR(report.parameters[0], 0.2, 1e-10);
  EXPECT_NEAR(report.parameters[1], 0.1, 1e-10);
  EXPECT_LT(report.interval.maxCoeff(), 1e-9);
}

TEST(Fit, IntervalsHoldWhatWasPlanted) {
  const std::array<int, 2> count = hits(20);
  for (const int held : count) {
    EXPECT_GE(held, 16);  // 19 are expected; fewer than 16 have the probability 0.003
  }
}

/// The coverage of 95 %, within what 100 trials show of it: 90 to 99 with a probability of 0.98.
TEST(Fit, IntervalsHoldWhatWasPlantedInNinetyFiveOfAHundred_slow) {
  const std::array<int, 2> count = hits(100);
  for (const int held : count) {
    EXPECT_GE(held, 90);
    EXPECT_LE(held, 99);
  }
}

TEST(Fit, TellsWhatTheDataDoNotDetermine) {
  const Registry registry = Registry::with_built_ins();
  FitProblem problem{[](const Vector& values) {
                       const Parameters changes{{"m", values[0]}, {"J", values[1]}};
                       return parametric_scene("chaplygin_sleigh", make_scene("chaplygin_sleigh", changes),
                                               {"m", "J"}, changes);
                     },
                     registry,
                     kinsol(),
                     {.method = "type1/gl:2", .step = 0.1}};
  const FitReport report = fit(problem, measured(1), Vector{{1.0, 0.1}});  // only J/m shows in the motion
  EXPECT_FALSE(report.interval.allFinite());
  EXPECT_NEAR(report.parameters[1] / report.parameters[0], 0.1, 0.02);
}

TEST(Fit, RefusesDataThatAreNone) {
  const Registry registry = Registry::with_built_ins();
  const FitProblem problem = sleigh_problem(registry);
  FitData data = measured(0);
  data.times[4] = 0.1;
  EXPECT_THROW((void)fit(problem, data, Vector{{0.3, 0.2}}), Misuse);
  data = measured(0);
  data.columns[0].sigma = 0.0;
  EXPECT_THROW((void)fit(problem, data, Vector{{0.3, 0.2}}), Misuse);
  data = measured(0);
  data.values.setConstant(std::nan(""));
  EXPECT_THROW((void)fit(problem, data, Vector{{0.3, 0.2}}), Misuse);
}

/// Tables of Student's distribution, 95 % and 99 %.
TEST(Fit, QuantilesOfStudentsDistribution) {
  EXPECT_NEAR(student_quantile(0.95, 1), 12.706204736, 1e-6);
  EXPECT_NEAR(student_quantile(0.95, 4), 2.776445105, 1e-8);
  EXPECT_NEAR(student_quantile(0.95, 10), 2.228138852, 1e-8);
  EXPECT_NEAR(student_quantile(0.99, 30), 2.749995654, 1e-8);
  EXPECT_NEAR(student_quantile(0.95, 1e5), 1.959987708, 1e-7);
}

}  // namespace
}  // namespace diracstep
