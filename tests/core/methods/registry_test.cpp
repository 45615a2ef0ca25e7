#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/methods/registry.hpp>

#include "methods.hpp"
#include "misuse.hpp"
#include "scenes.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::expect_misuse;

const Registry& built_ins() {
  static const Registry registry = Registry::with_built_ins();
  return registry;
}

void expect_unknown(const std::string& name, std::initializer_list<std::string> parts) {
  expect_misuse([&] { (void)built_ins().method(name); }, parts);
}

TEST(Registry, UnknownMethodListsTheKnownOnes) {
  for (const char* name : {"type1/midpiont", "", "midpoint", "type2/adjoint()", "type5/adjoint(type1/left)",
                           "type4/gl:2", "type1/gl:", "type1/gl:two"})
    expect_unknown(name, {std::string("'") + name + "'", "type1/midpoint", "type1/trapezoidal", "type2/euler",
                          "type3/euler", "type2/legendre(type1/left)", "typeN/gl:S", "typeN/adjoint("});
}

TEST(Registry, UnknownInnerMethodIsNamed) {
  expect_unknown("type3/legendre(type1/nonsense)", {"'type1/nonsense'", "type1/midpoint"});
  expect_unknown("type3/adjoint(type2/adjoint(type3/nonsense))", {"'type3/nonsense'", "type1/midpoint"});
}

TEST(Registry, NamesAreReadHoweverLongAndDeep) {
  std::string nested = "type1/left";
  for (int k = 0; k < 20; ++k) nested = "type1/adjoint(" + nested + ")";
  EXPECT_EQ(built_ins().method(nested).info.name, nested);
  std::string deep;
  for (int k = 0; k < 100'000; ++k) deep += "type1/adjoint(";
  for (const std::string& name : {deep, deep + "type1/left" + std::string(100'000, ')'),
                                  "type2/legendre(" + std::string(1'000'000, 'a') + ")"})
    expect_unknown(name, {"a method's name of " + std::to_string(name.size()) + " characters", "1000"});
}

TEST(Registry, EveryListedNameIsKnownAndSaysItsOwnName) {
  for (const std::string& name : built_ins().names()) {
    const MethodInfo info = built_ins().method(name).info;
    EXPECT_EQ(info.name, name);
    if (info.damped)
      EXPECT_FALSE(info.type) << name;
    else
      EXPECT_EQ(static_cast<int>(info.type.value()), name[4] - '0') << name;
    EXPECT_FALSE(info.summary.empty()) << name;
    EXPECT_GE(built_ins().method(name).make_step(*testing::unconstrained(), {true})->size(), 3) << name;
  }
}

MethodInfo info_named(const std::string& name) {
  return {name, GeneratingType::one, 2, true, StepRule::midpoint, "for a test"};
}

TEST(Registry, TakenNameIsRefused) {
  Registry registry = Registry::with_built_ins();
  expect_misuse([&] { registry.add(info_named("type1/midpoint"), nullptr); },
                {"'type1/midpoint'", "already registered"});
}

TEST(Registry, MalformedNameOrWrongTypeIsRefused) {
  Registry registry = Registry::with_built_ins();
  const std::size_t size = registry.names().size();
  for (const char* name : {"", "midpoint", "type1/", "type1/a b", "type1/a(b)", "Type1/a", "type5/a",
                           "type11/a", "type1/legendre(type1/left)", "type2/mine", "type1/a\n"})
    expect_misuse([&] { registry.add(info_named(name), nullptr); },
                  {std::string("'") + name + "'", "type1/construction"});
  EXPECT_EQ(registry.names().size(), size);
}

TEST(Registry, LegendreTransformLeadsFromTypeOneToTheOthersOnly) {
  for (const int type : {2, 3, 4}) {
    const std::string name = "type" + std::to_string(type) + "/legendre(type1/right)";
    const MethodInfo info = built_ins().method(name).info;
    EXPECT_EQ(static_cast<int>(info.type.value()), type);
    EXPECT_EQ(info.order, 1);
    EXPECT_EQ(info.constraint_rule, StepRule::right);
  }
  expect_unknown("type1/legendre(type1/left)",
                 {"type1/legendre(type1/left)", "from type 1 to types 2, 3 and 4"});
  expect_unknown("type3/legendre(type2/euler)", {"type3/legendre(type2/euler)", "from type 1"});
}

TEST(Registry, AdjointsExchangeTypesTwoAndThreeAndMirrorTheRule) {
  const MethodInfo info = built_ins().method("type3/adjoint(type2/euler)").info;
  EXPECT_EQ(info.type, GeneratingType::three);
  EXPECT_EQ(info.constraint_rule, StepRule::right);
  EXPECT_EQ(built_ins().method("type2/adjoint(type3/adjoint(type2/euler))").info.constraint_rule,
            StepRule::left);
  EXPECT_EQ(built_ins().method("type3/adjoint(type2/legendre(type1/left))").info.type, GeneratingType::three);
  EXPECT_EQ(built_ins().method("type1/adjoint(type1/left)").info.type, GeneratingType::one);
  EXPECT_EQ(built_ins().method("type4/adjoint(type4/legendre(type1/left))").info.type, GeneratingType::four);
}

TEST(Registry, AdjointOfTheWrongTypeIsRefusedWithTheRightName) {
  expect_unknown("type2/adjoint(type2/euler)", {"another type", "type3/adjoint(type2/euler)"});
  expect_unknown("type2/adjoint(type1/left)", {"another type", "type1/adjoint(type1/left)"});
}

TEST(Registry, AdjointOfAMethodIsItselfTheNamedOneOrMade) {
  const auto adjoint_of = [](const char* name) {
    return built_ins().adjoint_of(built_ins().method(name)).info.name;
  };
  EXPECT_EQ(adjoint_of("type1/midpoint"), "type1/midpoint");
  EXPECT_EQ(adjoint_of("type1/left"), "type1/right");
  EXPECT_EQ(adjoint_of("type3/euler"), "type2/euler");
  EXPECT_EQ(adjoint_of("type2/legendre(type1/left)"), "type3/adjoint(type2/legendre(type1/left))");
}

TEST(Registry, TheMadeAdjointStepsLikeTheNamedOne) {
  const std::pair<const char*, const char*> pairs[] = {
      {"type1/right", "type1/adjoint(type1/left)"},
      {"type3/euler", "type3/adjoint(type2/euler)"},
      {"type2/euler", "type2/adjoint(type3/euler)"},
      {"type2/euler", "type2/adjoint(type3/adjoint(type2/euler))"}};
  for (const auto& scene : testing::every_constraint_class())
    for (const auto& [named, made] : pairs) {
      const auto a = testing::samples_of(scene, {.method = named, .step = 0.05}, 10).back();
      const auto b = testing::samples_of(scene, {.method = made, .step = 0.05}, 10).back();
      EXPECT_LT((a.q - b.q).lpNorm<Eigen::Infinity>(), 1e-13) << scene->name << " " << made;
      EXPECT_LT((a.p - b.p).lpNorm<Eigen::Infinity>(), 1e-12) << scene->name << " " << made;
    }
}

TEST(Registry, GaussLobattoStepsHaveTwiceTheOrderOfTheirStages) {
  for (const int type : {1, 2, 3})
    for (const int stages : {1, 2, 5, 20}) {
      const MethodInfo info =
          built_ins().method("type" + std::to_string(type) + "/gl:" + std::to_string(stages)).info;
      EXPECT_EQ(static_cast<int>(info.type.value()), type);
      EXPECT_EQ(info.order, 2 * stages);
      EXPECT_TRUE(info.self_adjoint);
    }
  EXPECT_EQ(built_ins().adjoint_of(built_ins().method("type2/gl:3")).info.name, "type2/gl:3");
}

TEST(Registry, GaussLobattoStepsRefuseStagesTransformsAndRulesThatTheyLack) {
  expect_unknown("type1/gl:0", {"GL(0)", "1 to 20"});
  expect_unknown("type3/gl:21", {"GL(21)", "1 to 20"});
  expect_unknown("type2/legendre(type1/gl:2)", {"type1/gl:2", "nodes inside the step", "typeN/gl:S"});
  expect_unknown("type1/adjoint(type1/gl:2)", {"type1/gl:2", "nodes inside the step", "typeN/gl:S"});
  expect_misuse(
      [] {
        (void)built_ins().method("type1/gl:2").make_step(*testing::mixed(), {true, StepRule::left});
      },
      {"type1/gl:2", "its own nodes"});
}

/// Type 1 generating function of the exact flow of q'' = −q:  ((q0² + q1²) cos h − 2 q0 q1) / (2 sin h).
class ExactOscillator final : public GeneratingFunction {
 public:
  ExactOscillator() : GeneratingFunction(GeneratingType::one, SparsityPattern::dense(1, 1)) {}
  double value(Interval step, ConstColumnsRef y) override {
    return (y.squaredNorm() * std::cos(step.size) / 2.0 - y(0, 0) * y(0, 1)) / std::sin(step.size);
  }
  void gradient(Interval step, ConstColumnsRef y, ColumnsRef g) override {
    g(0, 0) = (y(0, 0) * std::cos(step.size) - y(0, 1)) / std::sin(step.size);
    g(0, 1) = (y(0, 1) * std::cos(step.size) - y(0, 0)) / std::sin(step.size);
  }
  void hessian(Interval step, ConstColumnsRef, ColumnsRef blocks) override {
    blocks(0, 0) = blocks(0, 2) = 1.0 / std::tan(step.size);
    blocks(0, 1) = -1.0 / std::sin(step.size);
  }
};

TEST(Registry, AMethodAddedByAUserStepsAScene) {
  Registry registry = Registry::with_built_ins();
  registry.add(info_named("type1/exact-oscillator"),
               [](const Scene&) { return std::make_unique<ExactOscillator>(); });
  Scene scene;
  scene.name = "oscillator";
  scene.coordinates = {"x"};
  scene.lagrangian =
      lagrangian<1>([](const auto& q, const auto& v) { return 0.5 * (v[0] * v[0] - q[0] * q[0]); });
  scene.start = {0.0, Vector::Constant(1, 1.0), Vector::Zero(1)};
  const auto shared = std::make_shared<const Scene>(scene);
  for (const char* name : {"type1/exact-oscillator", "type2/legendre(type1/exact-oscillator)",
                           "type4/adjoint(type4/legendre(type1/exact-oscillator))"}) {
    const auto samples =
        testing::samples_of(shared, {.method = name, .step = 0.7}, 10, Momentum::projected, registry);
    for (const Sample& sample : samples) {
      EXPECT_NEAR(sample.q[0], std::cos(sample.time), 1e-14) << name;
      EXPECT_NEAR(sample.p[0], -std::sin(sample.time), 1e-14) << name;
    }
  }
  expect_unknown("type1/exact-oscillator", {"unknown"});  // a registry is a value
}

TEST(Registry, MethodsThatNeedAHamiltonianRefuseADegenerateLagrangian) {
  Scene scene;
  scene.name = "degenerate";
  scene.coordinates = {"x", "y"};
  scene.lagrangian = lagrangian<2>(
      [](const auto& q, const auto& v) { return q[0] * v[1] - 0.5 * (q[0] * q[0] + q[1] * q[1]); });
  scene.start = {0.0, Vector::Ones(2), Vector::Zero(2)};
  for (const char* name : {"type2/euler", "type3/euler", "type3/adjoint(type2/euler)"})
    expect_misuse([&] { (void)built_ins().method(name).generating_function(scene); },
                  {"degenerate", "method of type 1"});
}

}  // namespace
}  // namespace diracstep
