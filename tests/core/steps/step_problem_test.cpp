#include <gtest/gtest.h>

#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/steps/step_problem.hpp>

#include "differences.hpp"
#include "methods.hpp"
#include "scenes.hpp"

namespace diracstep {
namespace {

class StepJacobian : public ::testing::TestWithParam<std::string> {};

TEST_P(StepJacobian, AgreesWithDifferencesForEveryConstraintClass) {
  const Method method = Registry::with_built_ins().method(GetParam());
  std::vector<std::shared_ptr<const Scene>> scenes;
  for (const auto& scene : testing::every_constraint_class()) {
    scenes.push_back(scene);
    if (method.info.type != GeneratingType::four) scenes.push_back(testing::forced(scene));
  }
  for (const auto& scene : scenes)
    for (const bool dense : {true, false}) {
      const auto problem = method.make_step(*scene, {dense});
      if (problem->size() == 0) continue;
      Vector p(3), lq(3), x(problem->size());
      scene->lagrangian->gradient(0.0, scene->start.q, scene->start.v, lq, p);
      problem->begin({0.0, 0.2}, scene->start.q, p);
      problem->guess(scene->start.v, x);
      x += 0.05 * Vector::LinSpaced(x.size(), -1.0, 1.3);
      EXPECT_LT(testing::jacobian_error(*problem, x), 2e-7) << scene->name << (dense ? ", full" : ", sparse");
    }
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, StepJacobian, ::testing::ValuesIn(testing::every_method()),
                         [](const auto& test) { return testing::test_name(test.param); });

TEST(StepProblem, ExplicitGraphsLeaveOnlyMultipliers) {
  Scene scene = testing::particle("separable");
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + 2.0 * v[1] * v[1] + v[2] * v[2]) - q[0] * q[0] * q[1] * q[1] - q[2] * q[2];
  });
  const Registry registry = Registry::with_built_ins();
  for (const char* name : {"type1/left", "type1/right", "type1/trapezoidal", "type2/euler", "type3/euler"}) {
    const Method method = registry.method(name);
    scene.constraints.clear();
    EXPECT_EQ(method.make_step(scene, {true})->size(), 0) << name;
    scene.constraints = testing::nonholonomic()->constraints;
    const auto constrained = method.make_step(scene, {true});
    EXPECT_EQ(constrained->size(), 1) << name;
    Vector x = Vector::Constant(1, 0.1);
    constrained->begin({0.0, 0.2}, scene.start.q, scene.start.v);
    EXPECT_LT(testing::jacobian_error(*constrained, x), 1e-8) << name;
  }
  const Method midpoint = registry.method("type1/midpoint");
  EXPECT_EQ(midpoint.make_step(scene, {true})->size(), 4);
}

}  // namespace
}  // namespace diracstep
