/// Every registered method is held to the conformance table that plugins are held to, GL(s) included; the
/// orders, which take longest, are held by order_table_test.
#include <gtest/gtest.h>

#include <diracstep/validation/laws/method_check.hpp>
#include <set>

namespace diracstep {
namespace {

class EveryRegisteredMethod : public ::testing::TestWithParam<std::string> {};

ConformanceTable table_of(const Registry& registry, const std::string& method) {
  CheckOptions options;
  options.proceed = [](const std::string& check) { return !check.starts_with("order, "); };
  return check_method(registry, method, {}, options);
}

TEST_P(EveryRegisteredMethod, PassesTheConformanceTable) {
  const ConformanceTable table = table_of(Registry::with_built_ins(), GetParam());
  std::set<std::string> applied;
  for (const Check& check : table.checks) {
    EXPECT_NE(check.result, Check::Result::fail)
        << check.name << ": " << check.figure << ", limit " << check.limit << ": " << check.detail;
    if (check.result == Check::Result::pass) applied.insert(check.name);
  }
  const bool damped = GetParam().starts_with("damped");
  for (const char* name :
       {"consistency", "holonomic rows", "nonholonomic rows", "two instances", "not a number"})
    EXPECT_TRUE(applied.contains(name)) << name << " was not looked at";
  for (const char* name : {"hessian", "symplecticity", "stated step"})
    EXPECT_NE(applied.contains(name), damped) << name << " belongs to what has a generating function";
  if (!damped && !GetParam().starts_with("type4")) {
    EXPECT_TRUE(applied.contains("membership"));
  }
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, EveryRegisteredMethod,
                         ::testing::ValuesIn(Registry::with_built_ins().names()), [](const auto& test) {
                           std::string name = test.param;
                           for (char& c : name)
                             if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
                           return name;
                         });

/// A method that states one generating function and steps another is found out.
TEST(Conformance, AStepThatIsNotTheStatedOneFails) {
  Registry registry = Registry::with_built_ins();
  Method method = registry.method("type1/midpoint");
  method.info.name = "type1/mislabelled";
  method.generating_function = registry.method("type1/trapezoidal").generating_function;
  registry.add(method);
  const ConformanceTable table = table_of(registry, "type1/mislabelled");
  std::set<std::string> failed;
  for (const Check& check : table.checks)
    if (check.result == Check::Result::fail) failed.insert(check.name);
  EXPECT_EQ(failed, (std::set<std::string>{"stated step", "membership"}));
}

/// Orders above 8 are lost in round-off before they show: 8 is asked for.
TEST(Conformance, HighOrdersAreHeldToWhatShows) {
  const std::vector<OrderScene> scenes = order_scenes();
  CheckOptions options;
  options.proceed = [](const std::string& check) { return check.starts_with("order, "); };
  Registry registry = Registry::with_built_ins();
  for (const char* name : {"type1/gl:5", "type1/gl:9"})
    for (const Check& check : check_method(registry, name, scenes, options).checks)
      EXPECT_NE(check.result, Check::Result::fail) << name << ", " << check.name << ": " << check.figure;
  Method method = registry.method("type1/gl:3");
  method.info.name = "type1/mislabelled";
  method.info.order = method.info.constrained_order = 10;
  registry.add(method);
  long failed = 0;
  for (const Check& check : check_method(registry, "type1/mislabelled", scenes, options).checks)
    failed += check.result == Check::Result::fail ? 1 : 0;
  EXPECT_EQ(failed, static_cast<long>(scenes.size()));
}

}  // namespace
}  // namespace diracstep
