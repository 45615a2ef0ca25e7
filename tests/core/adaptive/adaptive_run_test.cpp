/// run_steps() and run_until() mean the same for steps of one size and for steps that vary.
#include <gtest/gtest.h>

#include <diracstep/core/adaptive/adaptive_run.hpp>

#include "misuse.hpp"
#include "scenes.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

constexpr double h = 0.05;

const IntegratorOptions options{.method = "type1/gl:2", .step = h};

Integrator fixed() { return {testing::mixed(), Registry::with_built_ins(), kinsol(), options}; }
AdaptiveIntegrator variable() {
  return {testing::mixed(), Registry::with_built_ins(), kinsol(), options, {.eps = 0.1, .end = 2.0}};
}

/// The points that a run shows.
class Shown {
 public:
  bool operator()(const Sample& sample) {
    points.push_back(sample);
    return points.size() < limit;
  }
  std::vector<Sample> points;
  std::size_t limit = 1000;
};

template <class Stepper>
void expect_steps_are_counted(Stepper stepper) {
  Shown shown;
  ASSERT_TRUE(run_steps(stepper, 10, Momentum::projected, 4, std::ref(shown)).ok());
  EXPECT_EQ(stepper.work().steps, 10);
  ASSERT_EQ(shown.points.size(), 4U);  // 0, 4, 8, 10
  EXPECT_EQ(shown.points.front().time, 0.0);
  EXPECT_EQ(shown.points.back().time, stepper.time());
  ASSERT_TRUE(run_steps(stepper, 5).ok());
  EXPECT_EQ(stepper.work().steps, 15);
}

template <class Stepper>
void expect_time_is_reached(Stepper stepper, Stepper in_two) {
  constexpr double first = 0.6 + 0.3 * h, end = 1.0 + 0.7 * h;  // no points of the fixed steps
  Shown shown;
  ASSERT_TRUE(run_until(stepper, end, Momentum::projected, 3, std::ref(shown)).ok());
  EXPECT_EQ(shown.points.front().time, 0.0);
  EXPECT_EQ(shown.points.back().time, end);
  EXPECT_LT(stepper.time(), end) << "the end is read aside";
  EXPECT_GT(stepper.work().steps, 5);
  EXPECT_EQ(static_cast<long>(shown.points.size()), 2 + stepper.work().steps / 3);
  // The end that was read lies on the motion: GL(6) goes there too.
  const Sample expected =
      testing::samples_of(testing::mixed(), {.method = "type1/gl:6", .step = end / 40.0}, 40).back();
  EXPECT_LT((shown.points.back().q - expected.q).norm(), 1e-5);
  EXPECT_LT((shown.points.back().p - expected.p).norm(), 1e-5);
  // Reading on the way leaves no trace.
  ASSERT_TRUE(run_until(in_two, first, Momentum::projected, 1, std::ref(shown)).ok());
  ASSERT_TRUE(run_until(in_two, end, Momentum::projected, 1, std::ref(shown)).ok());
  EXPECT_EQ(in_two.time(), stepper.time());
  Sample a, b;
  ASSERT_TRUE(stepper.sample(Momentum::projected, a).ok());
  ASSERT_TRUE(in_two.sample(Momentum::projected, b).ok());
  EXPECT_EQ(a.q, b.q);
  EXPECT_EQ(a.p, b.p);
}

template <class Stepper>
void expect_observer_ends_it(Stepper stepper) {
  Shown shown;
  shown.limit = 3;
  ASSERT_TRUE(run_until(stepper, 1.0, Momentum::projected, 1, std::ref(shown)).ok());
  EXPECT_EQ(shown.points.size(), 3U);
  EXPECT_EQ(stepper.work().steps, 2);
}

template <class Stepper>
void expect_times_are_shown(Stepper stepper) {
  const std::vector<double> times{0.0, 0.013, 0.3, 0.31, 1.234};
  Shown shown;
  ASSERT_TRUE(run_at(stepper, times, Momentum::projected, std::ref(shown)).ok());
  ASSERT_EQ(shown.points.size(), times.size());
  for (std::size_t k = 0; k < times.size(); ++k) EXPECT_NEAR(shown.points[k].time, times[k], 1e-12);
}

template <class Stepper>
void expect_refusals(Stepper stepper) {
  const Observer none;
  for (const long every : {0L, -2L}) {
    testing::expect_misuse([&] { (void)run_steps(stepper, 3, Momentum::plus, every, none); }, {"every = "});
    testing::expect_misuse([&] { (void)run_until(stepper, 1.0, Momentum::plus, every, none); }, {"every = "});
  }
  testing::expect_misuse([&] { (void)run_until(stepper, -1.0); }, {"t = -1", "ahead"});
  testing::expect_misuse([&] { (void)run_until(stepper, std::nan("")); }, {"t = nan", "ahead"});
  const std::vector<double> unsorted{0.2, 0.1};
  testing::expect_misuse([&] { (void)run_at(stepper, unsorted); }, {"t = 0.1", "ahead"});
  EXPECT_EQ(stepper.work().steps, 0);
}

TEST(Runs, TakeAsManyStepsAsAskedFor) {
  expect_steps_are_counted(fixed());
  expect_steps_are_counted(variable());
}

TEST(Runs, ShowTheTimeAskedForAndReadItWithoutATrace) {
  expect_time_is_reached(fixed(), fixed());
  expect_time_is_reached(variable(), variable());
}

TEST(Runs, EndWhereTheObserverSaysSo) {
  expect_observer_ends_it(fixed());
  expect_observer_ends_it(variable());
}

TEST(Runs, ShowAnyTimes) {
  expect_times_are_shown(fixed());
  expect_times_are_shown(variable());
}

TEST(Runs, RefuseTheSame) {
  expect_refusals(fixed());
  expect_refusals(variable());
}

TEST(Runs, StayOnThePointThatIsTheEnd) {
  for (const double end : {1.0, 0.7}) {  // 0.7 is no multiple of 0.05 in binary
    Integrator integrator = fixed();
    Shown shown;
    ASSERT_TRUE(run_until(integrator, end, Momentum::projected, 7, std::ref(shown)).ok());
    EXPECT_EQ(integrator.work().steps, std::lround(end / h));
    EXPECT_NEAR(integrator.time(), end, 1e-14);
    EXPECT_EQ(shown.points.back().time, integrator.time());
    EXPECT_EQ(shown.points.size(), end == 1.0 ? 4U : 3U);  // 0, 7, 14, 20, and 0, 7, 14
    ASSERT_TRUE(run_until(integrator, end, Momentum::projected, 1, std::ref(shown)).ok()) << "already there";
    EXPECT_EQ(integrator.work().steps, std::lround(end / h));
  }
}

TEST(Runs, GoBackwards) {
  IntegratorOptions backwards = options;
  backwards.step = -h;
  Integrator integrator(testing::mixed(), Registry::with_built_ins(), kinsol(), backwards);
  Shown shown;
  ASSERT_TRUE(run_until(integrator, -0.52, Momentum::projected, 100, std::ref(shown)).ok());
  EXPECT_EQ(shown.points.back().time, -0.52);
  EXPECT_EQ(integrator.work().steps, 10);
  testing::expect_misuse([&] { (void)run_until(integrator, 0.1); }, {"ahead"});
}

}  // namespace
}  // namespace diracstep
