#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/adaptive/rate_survey.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <vector>

#include "misuse.hpp"
#include "scenes.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::expect_misuse;
using testing::samples_of;

/// Kepler's problem from the far end of an ellipse of half-axis 1: period 2π.
std::shared_ptr<const Scene> kepler(double eccentricity) {
  Scene scene;
  scene.name = "kepler";
  scene.coordinates = {"x", "y"};
  scene.lagrangian = lagrangian<2>([](const auto& q, const auto& v) {
    using std::sqrt;
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) + 1.0 / sqrt(q[0] * q[0] + q[1] * q[1]);
  });
  const double e = eccentricity;
  scene.start = {0.0, Vector(2), Vector(2)};
  scene.start.q << -(1.0 + e), 0.0;
  scene.start.v << 0.0, -std::sqrt((1.0 - e) / (1.0 + e));
  return std::make_shared<const Scene>(scene);
}

/// The angular velocity of a circular orbit there.
double circular_rate(double, ConstVectorRef q, ConstVectorRef) { return std::pow(q.norm(), -1.5); }

AdaptiveIntegrator adaptive(const std::shared_ptr<const Scene>& scene, const std::string& method,
                            const AdaptiveOptions& options, int order = 0, double step = 0.1) {
  return {
      scene, Registry::with_built_ins(), kinsol(), {.method = method, .order = order, .step = step}, options};
}

Sample end_of(AdaptiveIntegrator integrator, double end) {
  Sample last;
  const RunReport report =
      run_until(integrator, end, Momentum::projected, 1'000'000, [&](const Sample& sample) {
        last = sample;
        return true;
      });
  EXPECT_TRUE(report.ok()) << report.last.failure;
  EXPECT_EQ(last.time, end);
  return last;
}

double distance(const Sample& a, const Sample& b) {
  return std::max((a.q - b.q).lpNorm<Eigen::Infinity>(), (a.v - b.v).lpNorm<Eigen::Infinity>());
}

/// Steps there and, with the velocity turned, back: how far from the start it ends.
double reversal_defect(const std::shared_ptr<const Scene>& scene, const std::string& method, int order,
                       StepControl control) {
  const AdaptiveOptions options{.eps = 0.3, .control = control, .scales = {1.0, 0.3}};
  AdaptiveIntegrator there = adaptive(scene, method, options, order);
  for (int k = 0; k < 12; ++k) EXPECT_TRUE(there.step().ok());
  Sample turn;
  EXPECT_TRUE(there.sample(Momentum::projected, turn).ok());
  auto turned = std::make_shared<Scene>(*scene);
  turned->start = {0.0, turn.q, -turn.v};
  AdaptiveIntegrator back = adaptive(turned, method, options, order);
  for (int k = 0; k < 12; ++k) EXPECT_TRUE(back.step().ok());
  Sample end;
  EXPECT_TRUE(back.sample(Momentum::projected, end).ok());
  return std::max((end.q - scene->start.q).lpNorm<Eigen::Infinity>(),
                  (end.v + scene->start.v).lpNorm<Eigen::Infinity>());
}

TEST(AdaptiveIntegrator, EquationInTheStepIsReversible) {
  // The sizes are solved for to 1e-10; the motion amplifies that a little.
  for (const auto& scene : testing::every_constraint_class()) {
    EXPECT_LT(reversal_defect(scene, "type1/gl:2", 0, StepControl::in_step), 1e-8) << scene->name;
    EXPECT_LT(reversal_defect(scene, "type1/midpoint", 4, StepControl::in_step), 1e-8) << scene->name;
    EXPECT_GT(reversal_defect(scene, "type1/gl:2", 0, StepControl::irreversible), 1e-6) << scene->name;
  }
}

/// Over several times, so that no chance zero of the error counts; the reference has steps of 0.05.
double largest_error(AdaptiveIntegrator integrator, const std::vector<Sample>& reference) {
  const std::vector<std::size_t> places{20, 34, 45, 60, 72};
  std::vector<double> times;
  for (const std::size_t place : places) times.push_back(reference[place].time);
  double largest = 0.0;
  std::size_t k = 0;
  const RunReport report = run_at(integrator, times, Momentum::projected, [&](const Sample& sample) {
    largest = std::max(largest, distance(sample, reference[places[k++]]));
    return true;
  });
  EXPECT_TRUE(report.ok()) << report.last.failure;
  return largest;
}

TEST(AdaptiveIntegrator, KeepsTheOrderOnEveryConstraintClass) {
  for (const auto& scene : testing::every_constraint_class()) {
    const auto reference = samples_of(scene, {.method = "type1/gl:6", .step = 0.05}, 72);
    const auto error = [&](const std::string& method, int order, StepControl control, double eps) {
      const AdaptiveOptions options{.eps = eps, .control = control, .scales = {1.0, 0.3}};
      return largest_error(adaptive(scene, method, options, order), reference);
    };
    struct Case {
      const char* method;
      int order, measured;
      StepControl control;
      double eps;
    };
    for (const Case& c : {Case{"type1/gl:2", 0, 4, StepControl::integrating, 0.1},
                          Case{"type1/gl:3", 0, 6, StepControl::integrating, 0.5},
                          Case{"type1/gl:2", 0, 4, StepControl::in_step, 0.2},
                          Case{"type1/midpoint", 4, 4, StepControl::integrating, 0.1},
                          Case{"type1/midpoint", 4, 4, StepControl::in_step, 0.1},
                          Case{"type2/euler", 2, 2, StepControl::integrating, 0.02}}) {
      if (c.order == 2 && scene->rows() > 0) continue;  // measured elsewhere
      const double coarse = error(c.method, c.order, c.control, c.eps);
      const double fine = error(c.method, c.order, c.control, 0.25 * c.eps);
      EXPECT_GT(fine, 1e-13) << "at round-off, nothing is measured";
      EXPECT_NEAR(0.5 * std::log2(coarse / fine), c.measured, 0.5)
          << scene->name << ' ' << c.method << " control " << static_cast<int>(c.control) << ": " << coarse
          << ' ' << fine;
    }
  }
}

TEST(AdaptiveIntegrator, TakesFarFewerStepsThanAFixedOneOnAnEccentricOrbit) {
  const auto scene = kepler(0.9);
  const double end = 2.0 * std::acos(-1.0);
  for (const Monitor& monitor : {Monitor{}, Monitor{circular_rate, false}}) {
    AdaptiveIntegrator integrator =
        adaptive(scene, "type1/gl:4", {.eps = 0.35, .monitor = monitor, .end = end});
    Sample last;
    ASSERT_TRUE(run_until(integrator, end, Momentum::projected, 1'000'000, [&](const Sample& s) {
                  last = s;
                  return true;
                }).ok());
    EXPECT_LT((last.q - scene->start.q).lpNorm<Eigen::Infinity>(), 1e-5);
    EXPECT_LT(integrator.work().steps, 100);
    EXPECT_EQ(integrator.control().resets, 0);
    EXPECT_GT(integrator.control().largest_step, 10.0 * integrator.control().smallest_step);
    const long steps = integrator.work().steps;  // a fixed step with as many fails or is far off
    Integrator fixed(scene, Registry::with_built_ins(), kinsol(),
                     {.method = "type1/gl:4", .step = end / static_cast<double>(steps)});
    const RunReport report = run_steps(fixed, steps, Momentum::projected, steps, {});
    EXPECT_TRUE(!report.ok() || (fixed.position() - scene->start.q).lpNorm<Eigen::Infinity>() > 1e-3);
  }
}

double energy_error(AdaptiveIntegrator& integrator, double end) {
  double largest = 0.0;
  const double energy = integrator.integrator().scene().energy(0.0, integrator.integrator().scene().start.q,
                                                               integrator.integrator().scene().start.v);
  const RunReport report = run_until(integrator, end, Momentum::projected, 1, [&](const Sample& sample) {
    largest = std::max(largest, std::abs(sample.energy - energy));
    return largest < 1.0;
  });
  EXPECT_TRUE(report.ok()) << report.last.failure;
  return largest;
}

TEST(AdaptiveIntegrator, EnergyDoesNotDriftOverManyOrbitsAndDoesWithoutReversibility) {
  const auto scene = kepler(0.9);
  const auto growth = [&](StepControl control) {
    const AdaptiveOptions options{.eps = 0.2, .control = control, .monitor = {circular_rate, false}};
    AdaptiveIntegrator few = adaptive(scene, "type1/gl:2", options),
                       many = adaptive(scene, "type1/gl:2", options);
    const double late = energy_error(many, 600.0), early = energy_error(few, 60.0);
    return late / early;
  };
  EXPECT_LT(growth(StepControl::integrating), 1.5);
  EXPECT_LT(growth(StepControl::in_step), 1.5);
  EXPECT_GT(growth(StepControl::irreversible), 3.0);
}

TEST(AdaptiveIntegrator, OutputOffTheNodesHasFullOrderAndLeavesTheMainSequenceUntouched) {
  const auto scene = testing::nonholonomic();
  const auto make = [&](double eps) {
    return adaptive(scene, "type1/gl:3", {.eps = eps, .scales = {1.0, 0.3}});
  };
  const std::vector<double> times{0.0, 0.31, 0.32, 1.7, 2.2, 3.6};
  std::array<double, 2> errors{};
  for (std::size_t i = 0; i < 2; ++i) {
    AdaptiveIntegrator integrator = make(i == 0 ? 0.4 : 0.2), alone = make(i == 0 ? 0.4 : 0.2);
    std::vector<Sample> kept;
    ASSERT_TRUE(run_at(integrator, times, Momentum::projected, [&](const Sample& sample) {
                  kept.push_back(sample);
                  return true;
                }).ok());
    ASSERT_EQ(kept.size(), times.size());
    for (std::size_t k = 1; k < times.size(); ++k) {
      EXPECT_EQ(kept[k].time, times[k]);
      const Sample reference = samples_of(scene, {.method = "type1/gl:6", .step = times[k] / 64}, 64).back();
      errors[i] = std::max(errors[i], distance(kept[k], reference));
    }
    while (alone.work().steps < integrator.work().steps) ASSERT_TRUE(alone.step().ok());
    EXPECT_EQ(alone.time(), integrator.time());
    EXPECT_EQ(alone.integrator().position(), integrator.integrator().position());
    EXPECT_GT(integrator.control().side_steps, 3);
  }
  EXPECT_GT(errors[1], 1e-13);
  EXPECT_NEAR(std::log2(errors[0] / errors[1]), 6.0, 0.7) << errors[0] << ' ' << errors[1];
}

TEST(AdaptiveIntegrator, GoesBackInTime) {
  const auto scene = testing::mixed();
  const Sample reference = samples_of(scene, {.method = "type1/gl:6", .step = -2.0 / 64}, 64).back();
  const Sample end = end_of(adaptive(scene, "type1/gl:4", {.eps = 0.2, .scales = {1.0, 0.3}}, 0, -0.1), -2.0);
  EXPECT_LT(distance(end, reference), 1e-8);
}

TEST(AdaptiveIntegrator, TheGuardResetsTheControllerAndCounts) {
  // ω goes up and down within a step, so that its slope at the nodes says little.
  const Monitor rough{[](double, ConstVectorRef q, ConstVectorRef) { return 2.0 + std::sin(60.0 * q[0]); },
                      false};
  AdaptiveIntegrator coarse = adaptive(testing::nonholonomic(), "type1/gl:3", {.eps = 0.2, .monitor = rough});
  for (int k = 0; k < 300; ++k) ASSERT_TRUE(coarse.step().ok());
  EXPECT_GT(coarse.control().resets, 0);
  EXPECT_TRUE(coarse.control().lowest_ratio < 0.8 || coarse.control().highest_ratio > 1.25);
}

TEST(AdaptiveIntegrator, StepsAcrossAMotionWithoutAccelerations) {
  Scene free = *kepler(0.5);
  free.lagrangian =
      lagrangian<2>([](const auto&, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]); });
  const auto scene = std::make_shared<const Scene>(free);
  const Sample end = end_of(adaptive(scene, "type1/gl:2", {.end = 5.0}), 5.0);
  EXPECT_LT((end.q - scene->start.q - 5.0 * scene->start.v).lpNorm<Eigen::Infinity>(), 1e-14);
}

TEST(AdaptiveIntegrator, RepeatsBitByBitAfterReset) {
  AdaptiveIntegrator integrator = adaptive(testing::mixed(), "type1/gl:3", {.eps = 0.3});
  std::array<Vector, 2> ends;
  for (Vector& end : ends) {
    integrator.reset();
    for (int k = 0; k < 20; ++k) ASSERT_TRUE(integrator.step().ok());
    end = integrator.integrator().position();
  }
  EXPECT_EQ(ends[0], ends[1]);
}

TEST(AdaptiveIntegrator, RefusesWhatWouldNotBeReversible) {
  const auto scene = kepler(0.5);
  expect_misuse(
      [&] {
        adaptive(scene, "type1/gl:2",
                 {.monitor = {[](double, ConstVectorRef, ConstVectorRef v) { return 1.0 + 0.1 * v[1]; }}});
      },
      {"not even", "at v", "at -v"});
  expect_misuse(
      [&] {
        adaptive(scene, "type1/gl:2",
                 {.monitor = {[](double, ConstVectorRef q, ConstVectorRef) { return q[0]; }}});
      },
      {"monitor is -1.5", "positive"});
  expect_misuse([&] { adaptive(scene, "type1/left", {}); }, {"type1/left", "not self-adjoint"});
  EXPECT_NO_THROW(adaptive(scene, "type1/left", {}, 2));
  expect_misuse([&] { adaptive(scene, "type1/gl:2", {.eps = 0.0}); }, {"eps = 0", "above 0"});
  AdaptiveIntegrator integrator = adaptive(scene, "type1/gl:2", {});
  Sample sample;
  expect_misuse([&] { (void)integrator.sample_at(100.0, Momentum::projected, sample); },
                {"t = 100", "two steps"});
  expect_misuse([&] { (void)run_until(integrator, -1.0, Momentum::projected, 1, {}); }, {"t = -1", "ahead"});
  const std::vector<double> unsorted{0.2, 0.1};
  expect_misuse([&] { (void)run_at(integrator, unsorted, Momentum::projected, {}); }, {"t = 0.1", "ahead"});
}

TEST(RateSurvey, FindsTheFrequencyOfAnOscillatorAndTheRangeOfAnOrbit) {
  Scene spring = *kepler(0.5);
  spring.start.v *= 4.5 / spring.start.v.norm();  // a circle: |a|/|v| = 3 all along
  spring.lagrangian = lagrangian<2>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) - 4.5 * (q[0] * q[0] + q[1] * q[1]);
  });
  const RateSurvey steady = survey_rate(spring, kinsol(), 10.0, 400);
  EXPECT_EQ(steady.failure, "");
  EXPECT_NEAR(steady.fastest, 3.0, 0.3);
  EXPECT_LT(steady.ratio(), 2.0);
  const RateSurvey uneven = survey_rate(*kepler(0.9), kinsol(), 6.3, 400);
  EXPECT_EQ(uneven.failure, "");
  EXPECT_NEAR(uneven.covered, 6.3, 1e-9);
  EXPECT_GT(uneven.ratio(), 20.0);
}

}  // namespace
}  // namespace diracstep
