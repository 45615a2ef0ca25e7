#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <diracstep/validation/laws/count_allocations.hpp>
#include <diracstep/validation/laws/method_check.hpp>
#include <memory>
#include <string>
#include <vector>

/// The conformance table as GoogleTest tests, for those who write methods.  To be included in one source of a
/// test program, which it makes count its heap allocations.
namespace diracstep {

/// Passes when every check on the method does; else one failure for each line that fails.
class ConformanceTest : public ::testing::Test {
 public:
  ConformanceTest(std::shared_ptr<const Registry> registry, std::string method)
      : registry_(std::move(registry)), method_(std::move(method)) {}

  void TestBody() override {
    static const std::vector<OrderScene> scenes = order_scenes();
    const CheckOptions options{allocation_counter(), {}};
    for (const Check& check : check_method(*registry_, method_, scenes, options).checks)
      EXPECT_NE(check.result, Check::Result::fail) << method_ << ": " << check.name << ": " << check.figure
                                                   << ", limit " << check.limit << ": " << check.detail;
  }

 private:
  std::shared_ptr<const Registry> registry_;
  std::string method_;
};

/// Adds one test, Conformance.METHOD, for each method.  To be called before RUN_ALL_TESTS.
inline void register_conformance_tests(const Registry& registry, const std::vector<std::string>& methods) {
  const auto shared = std::make_shared<const Registry>(registry);
  for (const std::string& method : methods) {
    std::string name = method;
    std::ranges::replace_if(
        name, [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
    ::testing::RegisterTest(
        "Conformance", name.c_str(), nullptr, nullptr, __FILE__, __LINE__,
        [shared, method]() -> ConformanceTest* { return new ConformanceTest(shared, method); });
  }
}

}  // namespace diracstep
