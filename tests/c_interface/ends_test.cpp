/// Motions between two ends and optimal control from C.
#include <cmath>

#include "c_interface.hpp"

namespace diracstep::testing {

namespace {

/// A point pushed along a line, from x = 1 to rest at 0 by controls within their bounds.
const char* const pushed =
    "name = \"pushed\"\nlagrangian = \"v_x^2/2\"\ncoordinates = { x = {} }\nstart = { x = 1 }\n"
    "span = { end = 1, step = 0.05 }\n[parameters]\nu = { value = 0, min = -100, max = 100 }\n"
    "[force]\nx = \"u\"\n[control]\nparameters = [\"u\"]\ncost = \"u^2\"\n";

class CInterfaceEnds : public CInterface {
 protected:
  int solve(std::vector<diracstep_parameter> start, std::vector<diracstep_parameter> end,
            double until = 2.1) {
    options_.ends = 1;
    options_.end = until;
    ends_.of_start = static_cast<int>(start.size());
    ends_.at_start = start.data();
    ends_.of_end = static_cast<int>(end.size());
    ends_.at_end = end.data();
    return diracstep_solve_boundary(model_, &options_, &ends_, &arrays_.points, &found_);
  }

  diracstep_options options_{};
  diracstep_ends ends_{};
  diracstep_boundary found_{};
  Arrays arrays_{2, 0};
};

const std::vector<diracstep_parameter> from_perihelion{{"x", 1.0}, {"y", 0.0}},
    to_other{{"x", -0.3}, {"y", 1.1}};

TEST_F(CInterfaceEnds, AMotionBetweenTwoPlacesHasItsAction) {
  ASSERT_EQ(open("kepler_e06"), DIRACSTEP_OK);
  options_.step = 0.05;
  ASSERT_EQ(solve(from_perihelion, to_other), DIRACSTEP_OK) << diracstep_message();
  ASSERT_EQ(arrays_.points.count, 43);
  EXPECT_EQ(arrays_.q[0], 1.0);
  EXPECT_NEAR(arrays_.last_q(0), -0.3, 1e-13);
  EXPECT_NEAR(arrays_.last_q(1), 1.1, 1e-13);
  EXPECT_NEAR(arrays_.t[42], 2.1, 1e-14);
  // The gradient of the action is (−p0, pN), and p = v here.
  ASSERT_NE(found_.gradient, nullptr);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(found_.gradient[i], -arrays_.v[i], 1e-12);
    EXPECT_NEAR(found_.gradient[2 + i], arrays_.v[84 + i], 1e-12);
  }
  ASSERT_NE(found_.hessian, nullptr);
  EXPECT_NEAR(found_.hessian[1], found_.hessian[4], 1e-11);
  EXPECT_STREQ(found_.doubt, "");
  EXPECT_STREQ(found_.no_action, "");
  EXPECT_NEAR(arrays_.energy[0], arrays_.energy[42], 1e-9);
  EXPECT_FALSE(std::string(found_.method).empty());
}

TEST_F(CInterfaceEnds, AStepFromTheStartThatWasFoundLeadsToTheEnd) {
  ASSERT_EQ(open("kepler_e06"), DIRACSTEP_OK);
  options_.method = "type1/gl:3";
  options_.step = 0.05;
  ASSERT_EQ(solve(from_perihelion, to_other), DIRACSTEP_OK) << diracstep_message();
  diracstep_options stepping{};
  stepping.method = "type1/gl:3";
  stepping.step = 0.05;
  ASSERT_EQ(create(stepping), DIRACSTEP_OK);
  ASSERT_EQ(diracstep_reset(made_, 0.0, arrays_.q.data(), arrays_.v.data()), DIRACSTEP_OK);
  ASSERT_EQ(diracstep_step(made_, 42), DIRACSTEP_OK);
  double q[2];
  diracstep_state state{};
  state.q = q;
  ASSERT_EQ(diracstep_read(made_, DIRACSTEP_PROJECTED, &state), DIRACSTEP_OK);
  EXPECT_NEAR(q[0], -0.3, 1e-11);
  EXPECT_NEAR(q[1], 1.1, 1e-11);
}

TEST_F(CInterfaceEnds, APeriodicOrbitHasMultipliers) {
  ASSERT_EQ(open("lotka_volterra_2d"), DIRACSTEP_OK);
  ends_.periodic = 1;
  options_.step = 0.1;
  ASSERT_EQ(solve({}, {}, 5.0), DIRACSTEP_OK) << diracstep_message();
  EXPECT_NEAR(arrays_.q[0], arrays_.last_q(0), 1e-11);
  EXPECT_EQ(found_.free_directions, 1);
  ASSERT_EQ(found_.multipliers, 2);
  EXPECT_NEAR(std::hypot(found_.multiplier[0] - 1.0, found_.multiplier[1]), 0.0, 1e-4);
  EXPECT_EQ(found_.gradient, nullptr);
  EXPECT_TRUE(std::isnan(found_.action));
  EXPECT_NE(std::string(found_.no_action).find("linear in v"), std::string::npos);
}

TEST_F(CInterfaceEnds, AGuessChoosesTheMotion) {
  ASSERT_EQ(open("kepler_e06"), DIRACSTEP_OK);
  options_.step = 0.05;
  ASSERT_EQ(solve(from_perihelion, to_other), DIRACSTEP_OK) << diracstep_message();
  Arrays first = arrays_;
  ends_.guesses = static_cast<int>(first.points.count);
  ends_.guess_time = first.t.data();
  ends_.guess_q = first.q.data();
  ends_.guess_v = first.v.data();
  ASSERT_EQ(solve(from_perihelion, to_other), DIRACSTEP_OK) << diracstep_message();
  EXPECT_LE(found_.iterations, 2);
  std::swap(first.t[3], first.t[4]);
  EXPECT_EQ(solve(from_perihelion, to_other), DIRACSTEP_MISUSE);
  expect_message({"does not follow"});
  ends_.guess_v = nullptr;
  EXPECT_EQ(solve(from_perihelion, to_other), DIRACSTEP_MISUSE);
  expect_message({"v of the guess", "NULL"});
}

TEST_F(CInterfaceEnds, RefusesWithTheReason) {
  ASSERT_EQ(open("kepler_e06"), DIRACSTEP_OK);
  EXPECT_EQ(solve({}, {{"z", 1.0}}), DIRACSTEP_MISUSE);
  expect_message({"'z'", "the end", "v_ or p_"});
  EXPECT_EQ(solve({}, {{"x", std::nan("")}}), DIRACSTEP_MISUSE);
  expect_message({"finite"});
  EXPECT_EQ(solve({}, {{"x", 1.0}}), DIRACSTEP_MISUSE);
  expect_message({"4 conditions", "3 are given"});
  EXPECT_EQ(solve({}, {}), DIRACSTEP_MISUSE);
  expect_message({"nothing is asked of the end"});
  EXPECT_EQ(solve({}, {{nullptr, 1.0}}), DIRACSTEP_MISUSE);
  options_.eps = 0.1;
  EXPECT_EQ(solve({}, to_other), DIRACSTEP_MISUSE);
  expect_message({"one size"});
  options_.eps = 0.0;
  options_.step = 1e-9;
  EXPECT_EQ(solve({}, {{"v_x", 0.0}, {"v_y", 0.0}}), DIRACSTEP_MISUSE);
  expect_message({"are the most"});
  EXPECT_EQ(diracstep_solve_boundary(model_, nullptr, nullptr, &arrays_.points, &found_), DIRACSTEP_MISUSE);
  diracstep_source source{};
  source.text = ball;
  ASSERT_EQ(open(source), DIRACSTEP_OK);
  options_.step = 0.0;
  EXPECT_EQ(solve({}, {{"y", 1.0}}), DIRACSTEP_MISUSE);
  expect_message({"events"});
}

TEST_F(CInterfaceEnds, ASearchThatFindsNothingOrIsStoppedLeavesItsLastIterate) {
  ASSERT_EQ(open("kepler_e06"), DIRACSTEP_OK);
  options_.step = 0.05;
  ends_.max_iterations = 1;
  EXPECT_EQ(solve(from_perihelion, to_other), DIRACSTEP_FAILED);
  expect_message({"not converged", "iterations are used up"});
  EXPECT_EQ(arrays_.points.count, 43);
  const int stop = 1;
  ends_.stop = &stop;
  EXPECT_EQ(solve(from_perihelion, to_other), DIRACSTEP_INTERRUPTED);
  expect_message({"interrupted after 0"});
}

class CInterfaceControl : public CInterface {
 protected:
  CInterfaceControl() {
    diracstep_source source{};
    source.text = pushed;
    EXPECT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
    ends_.of_end = 2;
    ends_.at_end = rest_;
  }
  int solve() {
    return diracstep_solve_control(model_, nullptr, &ends_, &control_, &arrays_.points, &found_);
  }

  diracstep_parameter rest_[2]{{"x", 0.0}, {"v_x", 0.0}};
  diracstep_ends ends_{};
  diracstep_control control_{};
  diracstep_controlled found_{};
  Arrays arrays_{1, 0};
};

TEST_F(CInterfaceControl, ControlsOfLeastCostAreFound) {
  if (diracstep_can_control() == 0) GTEST_SKIP() << "built without Ipopt";
  control_.degree = 1;
  ASSERT_EQ(solve(), DIRACSTEP_OK) << diracstep_message();
  // u = 12 t − 6 in continuous time, at the cost ∫ u² = 12.
  EXPECT_NEAR(found_.cost, 12.0, 1e-7);
  EXPECT_STREQ(found_.doubt, "");
  ASSERT_EQ(found_.controls, 1);
  EXPECT_STREQ(found_.name[0], "u");
  ASSERT_EQ(found_.control_points, 40);
  for (long k = 0; k < found_.control_points; ++k)
    EXPECT_NEAR(found_.control_value[k], 12.0 * found_.control_time[k] - 6.0, 1e-5) << k;
  EXPECT_EQ(arrays_.points.count, 21);
  EXPECT_NEAR(arrays_.last_q(0), 0.0, 1e-9);
}

TEST_F(CInterfaceControl, BoundsHoldAndMayLeaveNothing) {
  if (diracstep_can_control() == 0) GTEST_SKIP() << "built without Ipopt";
  const diracstep_parameter least{"u", -4.5}, greatest{"u", 4.5};
  control_.of_least = control_.of_greatest = 1;
  control_.least = &least;
  control_.greatest = &greatest;
  ASSERT_EQ(solve(), DIRACSTEP_OK) << diracstep_message();
  EXPECT_GT(found_.cost, 12.0);
  for (long k = 0; k < found_.control_points; ++k) EXPECT_LE(std::abs(found_.control_value[k]), 4.5);
  const diracstep_parameter unknown{"w", 1.0};
  control_.least = &unknown;
  EXPECT_EQ(solve(), DIRACSTEP_MISUSE);
  expect_message({"'w'", "neither a coordinate nor a control"});
}

TEST_F(CInterfaceControl, WithoutAnEndOrATableItIsRefused) {
  if (diracstep_can_control() == 0) {
    EXPECT_EQ(solve(), DIRACSTEP_MISUSE);
    expect_message({"Ipopt"});
    return;
  }
  ends_.of_end = 0;
  EXPECT_EQ(solve(), DIRACSTEP_MISUSE);
  expect_message({"nothing is asked of the end", "end_cost"});
  ends_.of_end = 2;
  control_.degree = 9;
  EXPECT_EQ(solve(), DIRACSTEP_MISUSE);
  expect_message({"degree 9"});
  ASSERT_EQ(open("kepler_e06"), DIRACSTEP_OK);
  EXPECT_EQ(solve(), DIRACSTEP_MISUSE);
  expect_message({"[control]"});
}

TEST_F(CInterfaceControl, AFlagStopsTheSearch) {
  if (diracstep_can_control() == 0) GTEST_SKIP() << "built without Ipopt";
  const int stop = 1;
  ends_.stop = &stop;
  EXPECT_EQ(solve(), DIRACSTEP_INTERRUPTED);
  expect_message({"interrupted"});
}

}  // namespace

}  // namespace diracstep::testing
