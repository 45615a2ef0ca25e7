#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/adaptive/damping_survey.hpp>
#include <diracstep/core/adaptive/error_control.hpp>

#include "misuse.hpp"
#include "scenes.hpp"
#include "stepping.hpp"

#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ < 13
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"  // of empty functions in options, which are made empty
#endif

namespace diracstep {
namespace {

using testing::expect_misuse;

constexpr double damping = 1e6;

/// v̇ = −c (v − cos t) from rest: a current behind an inductance of 1/c, driven by a voltage.
std::shared_ptr<const Scene> follower(double c) {
  Scene scene;
  scene.name = "follower";
  scene.coordinates = {"x"};
  scene.lagrangian = lagrangian<1>([](const auto&, const auto& v) { return 0.5 * v[0] * v[0]; });
  scene.force = force<1>([c]<class T>(const std::array<T, 1>&, const std::array<T, 1>& v, const T& t) {
    using std::cos;
    return std::array<T, 1>{c * (cos(t) - v[0])};
  });
  scene.start = {0.0, Vector::Zero(1), Vector::Zero(1)};
  return std::make_shared<const Scene>(scene);
}

/// Its velocity: the linear equation solved.
double velocity_of_follower(double c, double t) {
  const double size = c * c + 1.0;
  return (c * c * std::cos(t) + c * std::sin(t)) / size - c * c / size * std::exp(-c * t);
}

AdaptiveIntegrator variable(const std::shared_ptr<const Scene>& scene, const AdaptiveOptions& adaptive,
                            const std::string& method = "damped/radau:3") {
  return {scene, Registry::with_built_ins(), kinsol(), {.method = method, .step = 0.1}, adaptive};
}

TEST(LocalError, StepsStartSmallAndGrowOnceTransientsHaveDiedOut) {
  AdaptiveIntegrator integrator = variable(follower(damping), {.eps = 1e-6, .end = 10.0});
  Sample end;
  ASSERT_TRUE(run_until(integrator, 10.0, Momentum::projected, 1, [&](const Sample& at) {
                end = at;
                return true;
              }).ok());
  EXPECT_EQ(end.time, 10.0);
  EXPECT_NEAR(end.v[0], velocity_of_follower(damping, 10.0), 1e-6);
  EXPECT_LT(integrator.control().smallest_step, 2e-5);
  EXPECT_GT(integrator.control().largest_step, 0.3);
  EXPECT_GT(integrator.control().largest_step, 1e4 * integrator.control().smallest_step);
  EXPECT_LT(integrator.work().steps, 80);
  EXPECT_GE(integrator.work().solves, 3 * integrator.work().steps) << "whole steps count with their halves";
}

TEST(LocalError, TheErrorFallsWithTheOneAskedFor) {
  const auto scene = testing::forced(testing::mixed());
  const Sample reference =
      testing::samples_of(scene, {.method = "type1/gl:6", .step = 3.6 / 144}, 144).back();
  for (const int s : {2, 3, 5}) {
    double before = HUGE_VAL;
    for (const double eps : {1e-4, 1e-6, 1e-8}) {
      AdaptiveIntegrator integrator =
          variable(scene, {.eps = eps, .end = 3.6}, "damped/radau:" + std::to_string(s));
      Sample end;
      ASSERT_TRUE(run_until(integrator, 3.6, Momentum::projected, 1, [&](const Sample& at) {
                    end = at;
                    return true;
                  }).ok());
      const double error = (testing::join(end.q, end.p) - testing::join(reference.q, reference.p)).norm();
      EXPECT_LT(error, 10.0 * eps) << s;  // those of all steps add up
      EXPECT_LT(error, 0.1 * before) << s;
      before = error;
    }
  }
}

TEST(LocalError, LandsOnGivenTimesWithoutLeavingATrace) {
  const std::array<double, 3> times{1e-6, 0.123, 7.7};
  AdaptiveIntegrator shown = variable(follower(damping), {.eps = 1e-6, .end = 10.0}),
                     plain = variable(follower(damping), {.eps = 1e-6, .end = 10.0});
  std::vector<Sample> samples;
  ASSERT_TRUE(run_at(shown, times, Momentum::projected, [&](const Sample& at) {
                samples.push_back(at);
                return true;
              }).ok());
  ASSERT_EQ(samples.size(), 3U);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(samples[k].time, times.at(k));
    EXPECT_NEAR(samples[k].v[0], velocity_of_follower(damping, times.at(k)), 2e-6) << k;
  }
  while (plain.time() < shown.time()) ASSERT_TRUE(plain.step().ok());
  EXPECT_EQ(plain.time(), shown.time());
  EXPECT_EQ(plain.integrator().position(), shown.integrator().position());
  EXPECT_EQ(plain.integrator().momentum(), shown.integrator().momentum());
}

/// A jump of the force at t = 1.
class Switch final : public Kinks {
 public:
  Switch() : Kinks({}, {}) {}
  void evaluate(double, ConstVectorRef, ConstVectorRef, VectorRef) const override {}
  std::vector<Instant> instants(double first, double last) const override {
    return first < 1.0 && last > 1.0 ? std::vector<Instant>{{1.0, 0.0}} : std::vector<Instant>{};
  }
};

TEST(LocalError, EndsAStepAtASwitchAndStartsSmallAgain) {
  Scene scene = *follower(1.0);
  scene.force = force<1>([]<class T>(const std::array<T, 1>&, const std::array<T, 1>& v, const T& t) {
    return std::array<T, 1>{(t < 1.0 ? 0.0 : 1e6) * (1.0 - v[0])};
  });
  scene.kinks = std::make_shared<const Switch>();
  AdaptiveIntegrator integrator = variable(std::make_shared<const Scene>(scene), {.eps = 1e-6, .end = 3.0});
  std::vector<double> times;
  Sample end;
  ASSERT_TRUE(run_until(integrator, 3.0, Momentum::projected, 1, [&](const Sample& at) {
                times.push_back(at.time);
                end = at;
                return true;
              }).ok());
  const auto at_switch = std::ranges::find_if(times, [](double t) { return std::abs(t - 1.0) < 1e-12; });
  ASSERT_NE(at_switch, times.end());
  EXPECT_LT(*(at_switch + 1) - *at_switch, 1e-5);
  EXPECT_NEAR(end.v[0], 1.0, 1e-9);
  EXPECT_NEAR(end.q[0], 2.0 - 1e-6, 1e-9);
  EXPECT_LT(times.size(), 60U);
}

TEST(LocalError, AFailureLeavesTheLastNode) {
  AdaptiveIntegrator integrator = variable(testing::edge_of_the_domain(), {.eps = 1e-6, .end = 5.0});
  StepReport report;
  while ((report = integrator.step()).ok()) ASSERT_LT(integrator.time(), 5.0);
  EXPECT_FALSE(report.failure.empty());
  EXPECT_GT(integrator.integrator().position()[0], 0.99) << "steps shrink up to the edge";
  EXPECT_LT(integrator.integrator().position()[0], 1.0);
  EXPECT_GT(integrator.control().refused, 0);
}

TEST(LocalError, TakesLagrangiansLinearInV) {
  AdaptiveIntegrator integrator = variable(laws::phase_space(), {.eps = 1e-8, .end = 3.0});
  Sample end;
  ASSERT_TRUE(run_until(integrator, 3.0, Momentum::projected, 1, [&](const Sample& at) {
                end = at;
                return true;
              }).ok());
  const Sample reference =
      testing::samples_of(laws::phase_space(), {.method = "type1/gl:6", .step = 0.02}, 150).back();
  EXPECT_LT((end.q - reference.q).norm(), 1e-6);
}

TEST(LocalError, BelongsToTheDampingFamilyAndToNoOther) {
  const auto scene = testing::unconstrained();
  expect_misuse([&] { variable(scene, {.control = StepControl::local_error}, "type1/gl:3"); },
                {"type1/gl:3", "damped/radau:S"});
  expect_misuse([&] { variable(scene, {.control = StepControl::in_step}); },
                {"damped/radau:3", "local error only"});
  const AdaptiveIntegrator integrator = variable(scene, {.end = 1.0});
  EXPECT_EQ(integrator.adaptive().control, StepControl::local_error);
  EXPECT_EQ(integrator.adaptive().eps, 1e-6);
}

TEST(LocalError, ServesAnErrorAskedFor) {
  for (const auto& scene : {follower(damping), testing::forced(testing::nonholonomic())})
    for (const double error : {1e-4, 1e-7}) {
      const ErrorControlReport report = solve_to_error(scene, Registry::with_built_ins(), kinsol(), 3.0,
                                                       {.error = error, .method = "damped/radau:3"});
      ASSERT_TRUE(report.ok()) << scene->name << ": " << report.refusal;
      EXPECT_TRUE(report.adaptive);
      if (scene->name != "follower") continue;
      EXPECT_NEAR(report.end.v[0], velocity_of_follower(damping, 3.0), error);
    }
}

TEST(DampingSurvey, TellsStrongDampingFromWeak) {
  const Registry registry = Registry::with_built_ins();
  const auto survey = [&](const std::shared_ptr<const Scene>& scene, double step) {
    return survey_damping(scene, registry, kinsol(), 10.0, step);
  };
  const DampingSurvey strong = survey(follower(damping), 0.1);
  EXPECT_TRUE(strong.strong());
  EXPECT_NEAR(strong.rate, damping, 1e-3 * damping);
  EXPECT_NEAR(strong.product, 0.1 * damping, 1e-2 * damping);
  EXPECT_FALSE(survey(follower(damping), 1e-6).strong()) << "steps that resolve it need no damping";
  const DampingSurvey weak = survey(follower(1.0), 0.1);
  EXPECT_EQ(weak.failure, "");
  EXPECT_NEAR(weak.rate, 1.0, 1e-4);
  EXPECT_FALSE(weak.strong());
  for (const auto& scene : testing::every_constraint_class())
    EXPECT_FALSE(survey(testing::forced(scene), 0.1).strong()) << scene->name;
  EXPECT_FALSE(survey(testing::unconstrained(), 0.1).strong());
  EXPECT_FALSE(survey(testing::unconstrained(), 0.1).failure.empty()) << "nothing damps without a force";
}

/// The rate of a force that is linear in v, on scenes with rows: −Re λ of M v̇ = −c v along the distribution.
TEST(DampingSurvey, MeasuresAlongTheRows) {
  Scene scene = *testing::nonholonomic();
  scene.lagrangian = lagrangian<3>(
      [](const auto&, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); });
  scene.force = force<3>([]<class T>(const std::array<T, 3>&, const std::array<T, 3>& v) {
    return std::array<T, 3>{-5.0 * v[0], -5.0 * v[1], -5.0 * v[2]};
  });
  const DampingSurvey survey =
      survey_damping(std::make_shared<const Scene>(scene), Registry::with_built_ins(), kinsol(), 1.0, 0.1);
  EXPECT_EQ(survey.failure, "");
  EXPECT_NEAR(survey.rate, 5.0, 0.5);
}

TEST(DampingSurvey, ChoosesTheDefault) {
  const Registry registry = Registry::with_built_ins();
  const auto choice = [&](const std::shared_ptr<const Scene>& scene, const MethodRequest& request) {
    return default_method_of_motion(scene, registry, kinsol(), 10.0, 0.1, {}, request);
  };
  EXPECT_EQ(choice(follower(damping), {}).method, "damped/radau:3");
  EXPECT_NE(choice(follower(damping), {}).reason.find("strong damping"), std::string::npos);
  EXPECT_EQ(choice(follower(damping), {.order = 4}).method, "type1/gl:2");
  EXPECT_EQ(choice(follower(1.0), {}).method, "type1/gl:3");
  EXPECT_EQ(choice(testing::mixed(), {}).method, "type1/gl:3");
}

}  // namespace
}  // namespace diracstep
