#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/validation/studies/work_precision.hpp>

namespace diracstep {
namespace {

/// Points of error = constant · step^order, with time 1/step, down to a floor.
std::vector<WorkPoint> power_law(double constant, double order, double floor, int count, double first = 0.5) {
  std::vector<WorkPoint> points;
  for (int i = 0; i < count; ++i) {
    const double step = first * std::pow(0.5, i);
    points.push_back({step, std::max(floor, constant * std::pow(step, order)), 1.0 / step});
  }
  return points;
}

TEST(RelativeError, IsAbsoluteWhereTheReferenceIsZero) {
  EXPECT_DOUBLE_EQ(relative_error(Vector::Constant(2, 1.5), Vector::Constant(2, 1.0)), 0.5);
  EXPECT_DOUBLE_EQ(relative_error(Vector::Constant(2, 0.25), Vector::Zero(2)), 0.25);
  EXPECT_DOUBLE_EQ(relative_error(Vector::Constant(1, 0.25), Vector::Constant(1, 1e-16)), 0.25);
  EXPECT_TRUE(std::isnan(relative_error(Vector::Constant(1, NAN), Vector::Ones(1))));
}

TEST(RelativeError, ZeroIsToldByTheSizeThatIsNatural) {
  const Vector value = Vector::Constant(1, 1e-27), reference = Vector::Constant(1, 2e-27);
  EXPECT_DOUBLE_EQ(relative_error(value, reference, 1e-27), 0.5);
  EXPECT_DOUBLE_EQ(relative_error(Vector::Constant(1, 3e-43), Vector::Constant(1, 1e-43), 1e-27), 2e-16);
  EXPECT_DOUBLE_EQ(relative_error(value, Vector::Zero(1), 0.0), 1e-27);
}

TEST(MeasureOrder, ReadsThePowerOffItsPoints) {
  for (const double order : {1.0, 2.0, 4.0, 8.0}) {
    const auto fit = measure_order(power_law(0.1, order, 0.0, 6));
    ASSERT_TRUE(fit.has_value()) << order;
    EXPECT_NEAR(fit->slope, order, 1e-9);  // exact but for round-off of the logarithms
  }
}

TEST(MeasureOrder, LeavesOutRoundOffAndCoarseSteps) {
  auto points = power_law(1.0, 4.0, 3e-10, 12);
  points.front().error = 0.5;  // coarser than the power law says
  const auto fit = measure_order(points);
  ASSERT_TRUE(fit.has_value());
  EXPECT_NEAR(fit->slope, 4.0, 1e-9);
}

TEST(MeasureOrder, TakesNoLevelStretchForAnOrder) {
  EXPECT_FALSE(measure_order(power_law(1.0, 0.0, 0.0, 8)).has_value());
  EXPECT_FALSE(measure_order(power_law(1e-9, 0.0, 0.0, 8)).has_value());
}

TEST(MeasureOrder, NeedsThreeDifferentSteps) {
  EXPECT_FALSE(measure_order(power_law(0.01, 2.0, 0.0, 2)).has_value());
  EXPECT_TRUE(measure_order(power_law(0.01, 2.0, 0.0, 3)).has_value());
  EXPECT_FALSE(measure_order({{0.1, 1e-3, 1.0}, {0.1, 1e-4, 1.0}, {0.05, 1e-5, 1.0}}).has_value());
}

TEST(MeasureOrder, IgnoresTheSignOfTheStepAndFailedPoints) {
  auto points = power_law(0.1, 2.0, 0.0, 5);
  points.push_back({0.001, NAN, 1.0});
  for (WorkPoint& point : points) point.step = -point.step;
  ASSERT_TRUE(measure_order(points).has_value());
  EXPECT_NEAR(measure_order(points)->slope, 2.0, 1e-9);
}

TEST(CpuSecondsAt, InterpolatesLogLog) {
  const std::vector<WorkPoint> points{{0.1, 1e-2, 1.0}, {0.05, 1e-4, 100.0}};
  ASSERT_TRUE(cpu_seconds_at(points, 1e-3).has_value());
  EXPECT_NEAR(*cpu_seconds_at(points, 1e-3), 10.0, 1e-12);
  EXPECT_NEAR(*cpu_seconds_at(points, 1e-2), 1.0, 1e-12);
  EXPECT_NEAR(*cpu_seconds_at(points, 1e-4), 100.0, 1e-10);
}

TEST(CpuSecondsAt, NeverExtrapolates) {
  const std::vector<WorkPoint> points{{0.1, 1e-2, 1.0}, {0.05, 1e-4, 100.0}};
  EXPECT_FALSE(cpu_seconds_at(points, 1.1e-2).has_value());
  EXPECT_FALSE(cpu_seconds_at(points, 0.9e-4).has_value());
  EXPECT_FALSE(cpu_seconds_at({}, 1e-3).has_value());
}

TEST(CpuSecondsWithin, TakesTheCheapestPointWhereThatIsExactEnough) {
  const std::vector<WorkPoint> points{{0.1, 1e-2, 1.0}, {0.05, 1e-4, 100.0}};
  EXPECT_EQ(cpu_seconds_within(points, 1e-1), 1.0);
  EXPECT_NEAR(*cpu_seconds_within(points, 1e-3), 10.0, 1e-12);
  EXPECT_FALSE(cpu_seconds_within(points, 0.9e-4).has_value());
  EXPECT_FALSE(cpu_seconds_within({}, 1e-3).has_value());
}

TEST(CpuSecondsAt, LeavesOutBeatenPoints) {
  const std::vector<WorkPoint> points{
      {0.1, 1e-2, 1.0}, {0.07, 5e-2, 2.0}, {0.05, 1e-4, 100.0}, {0.01, 1e-3, 900.0}};
  EXPECT_EQ(lower_envelope(points).size(), 2u);
  EXPECT_NEAR(*cpu_seconds_at(points, 1e-3), 10.0, 1e-12);
}

}  // namespace
}  // namespace diracstep
