#include <gtest/gtest.h>

#include <diracstep/core/runs/run.hpp>
#include <type_traits>

#include "scenes.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

static_assert(std::is_base_of_v<std::runtime_error, Error>);
static_assert(std::is_base_of_v<Error, Misuse>);

/// The message of the Error that `action` throws, or nothing.
template <class Action>
std::string error_of(Action action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(Errors, OneTypeCatchesWhatTheLibraryThrows) {
  Integrator integrator(testing::mixed(), Registry::with_built_ins(), kinsol(), {.step = 0.1});
  EXPECT_NE(error_of([&] { (void)integrator.step(0.0); }), "");
  EXPECT_NE(error_of([&] { (void)run_steps(integrator, 1, Momentum::plus, 0); }), "");
  EXPECT_NE(error_of([&] { (void)Registry::with_built_ins().method("type1/nonsense"); }), "");
  Vector phi(1);
  const auto contact = pfaffian<3, 1>(laws::Contact{});
  EXPECT_NE(error_of([&] { contact->position(0.0, Vector::Zero(3), phi); }), "");
}

TEST(Errors, NumbersInMessagesHaveSixDigitsOrAsManyAsAskedFor) {
  EXPECT_EQ(to_text(1.0 / 3.0), "0.333333");
  EXPECT_EQ(to_text(1.0 / 3.0, 3), "0.333");
  EXPECT_EQ(to_text(2.0), "2");
  EXPECT_EQ(to_text(1e-20), "1e-20");
}

}  // namespace
}  // namespace diracstep
