#include <gtest/gtest.h>

#include <algorithm>
#include <diracstep/core/methods/default_method.hpp>

#include "misuse.hpp"
#include "scenes.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

/// Three oscillators whose kinetic energy depends on q.
std::shared_ptr<const Scene> coupled_oscillators() {
  Scene scene;
  scene.name = "oscillators";
  scene.coordinates = {"x", "y", "z"};
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    const auto kinetic = 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    return kinetic * (1.0 + q[0] * q[0]) - 0.25 * q[0] * q[0] * q[1] * q[1];
  });
  scene.start = {0.0, Vector::Ones(3), Vector::Zero(3)};
  return std::make_shared<const Scene>(scene);
}

/// A chain of unit masses.
template <int N>
std::shared_ptr<const Scene> separable() {
  Scene scene;
  scene.name = "separable";
  for (int i = 0; i < N; ++i) scene.coordinates.push_back("q" + std::to_string(i));
  scene.lagrangian = lagrangian<N>([](const auto& q, const auto& v) {
    auto sum = 0.5 * v[0] * v[0] - 0.25 * q[0] * q[0] * q[0] * q[0];
    for (std::size_t i = 1; i < N; ++i)
      sum = sum + 0.5 * v[i] * v[i] - 0.5 * (q[i] - q[i - 1]) * (q[i] - q[i - 1]);
    return sum;
  });
  scene.start = {0.0, Vector::LinSpaced(N, 0.0, 1.0), Vector::Zero(N)};
  return std::make_shared<const Scene>(scene);
}

TEST(DefaultMethod, IsGaussLobattoWithThreeStagesOrTheOrderAskedFor) {
  for (const auto& scene : testing::every_constraint_class()) {
    EXPECT_EQ(default_method(*scene, {}).method, "type1/gl:3") << scene->name;
    EXPECT_EQ(default_method(*scene, {.order = 8}).method, "type1/gl:4") << scene->name;
    EXPECT_EQ(default_method(*scene, {.order = 12, .large = 1}).method, "type1/gl:6")
        << scene->name;  // large, and not explicit
  }
}

TEST(DefaultMethod, IsTheExplicitStepOnLargeSeparableScenesWithoutRows) {
  const DefaultMethod large = default_method(*separable<3>(), {.large = 2});
  EXPECT_EQ(large.method, "type1/trapezoidal");
  EXPECT_EQ(large.order, 6);
  EXPECT_EQ(default_method(*separable<3>(), {.large = 3}).method, "type1/gl:3");
  EXPECT_EQ(default_method(*separable<3>(), {.order = 12, .large = 2}).method, "type1/gl:6")
      << "no composition has order 12";
  EXPECT_EQ(default_method(*coupled_oscillators(), {.large = 2}).method, "type1/gl:3");
  Integrator integrator(separable<3>(), Registry::with_built_ins(), kinsol(),
                        {.step = 0.1, .dense_limit = 2});
  ASSERT_TRUE(integrator.step().ok());
  EXPECT_EQ(integrator.work().residual_evaluations, 0) << "not explicit";
}

TEST(DefaultMethod, LeavesARuleForTheRowsToTheMidpointStep) {
  const DefaultMethod choice =
      default_method(*testing::nonholonomic(), {.order = 4, .rule = StepRule::trapezoidal});
  EXPECT_EQ(choice.method, "type1/midpoint");
  EXPECT_EQ(choice.order, 4);
  EXPECT_NE(choice.reason.find("trapezoidal"), std::string::npos);
  const auto order_with_rule = [](int order, double error) {
    return default_method(*testing::nonholonomic(),
                          {.order = order, .error = error, .rule = StepRule::trapezoidal})
        .order;
  };
  EXPECT_EQ(order_with_rule(0, 0.0), 0) << "the method's own";
  EXPECT_EQ(order_with_rule(0, 1e-7), 8);
  EXPECT_EQ(order_with_rule(0, 1e-11), 10) << "no composition has order 12";
  EXPECT_EQ(order_with_rule(4, 1e-11), 4) << "the order asked for goes before the error";
}

TEST(DefaultMethod, AnErrorDecidesTheOrderAndTheOrderTheMethod) {
  const auto with_error = [](const Scene& scene, double error, int large = 40) {
    return default_method(scene, {.error = error, .large = large});
  };
  for (const auto& scene : testing::every_constraint_class()) {
    EXPECT_EQ(with_error(*scene, 1e-4).method, "type1/gl:3") << scene->name;
    EXPECT_EQ(with_error(*scene, 1e-9).method, "type1/gl:4") << scene->name;
    EXPECT_EQ(with_error(*scene, 1e-10).method, "type1/gl:6") << scene->name;
  }
  EXPECT_EQ(with_error(*separable<20>(), 1e-7).order, 6);
  EXPECT_EQ(with_error(*separable<20>(), 1e-9).order, 8);
  for (const double error : {1e-3, 1e-6, 1e-9}) {
    const DefaultMethod choice = with_error(*separable<45>(), error);
    EXPECT_EQ(choice.method, "type1/trapezoidal") << "an error asked for is no reason for an implicit step";
    EXPECT_EQ(choice.order, error > 1e-7 ? 4 : 6);
    EXPECT_TRUE(choice.explicit_steps);
    const DefaultMethod same = default_method(*separable<45>(), {.order = choice.order});
    EXPECT_EQ(same.method, choice.method);
  }
  EXPECT_EQ(with_error(*separable<45>(), 1e-6, 50).method, "type1/gl:2");
  EXPECT_FALSE(with_error(*separable<45>(), 1e-6, 50).explicit_steps);
}

TEST(DefaultMethod, RefusesOrdersThatItHasNoMethodFor) {
  for (const int order : {-2, 1, 3, 42})
    testing::expect_misuse([&] { (void)default_method(*testing::mixed(), {.order = order}); },
                           {"order " + std::to_string(order), "2, 4, 6, 8, … 40"});
}

TEST(DefaultMethod, IsWhatAnIntegratorTakesAndItsPlanSaysWhy) {
  const Integrator integrator(testing::mixed(), Registry::with_built_ins(), kinsol(), {.step = 0.1});
  EXPECT_EQ(integrator.options().method, "type1/gl:3");
  EXPECT_EQ(integrator.options().order, 6);
  const auto plan = integrator.plan();
  EXPECT_TRUE(std::ranges::any_of(plan, [](const PlanLine& line) {
    return line.item == "method" && line.decision == "by default" && !line.reason.empty();
  }));
}

}  // namespace
}  // namespace diracstep
