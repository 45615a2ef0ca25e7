#include <cmath>

#include "c_interface.hpp"

namespace diracstep::testing {
namespace {

TEST_F(CInterface, EventsActInRunsAndInSingleSteps) {
  diracstep_source source{};
  source.text = ball;
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  EXPECT_EQ(listed(DIRACSTEP_EVENTS), (std::vector<std::string>{"floor", "top"}));
  EXPECT_EQ(listed(DIRACSTEP_EVENTS, 1), (std::vector<std::string>{"act", "stop"}));
  EXPECT_EQ(listed(DIRACSTEP_OUTPUTS), (std::vector<std::string>{"count", "twice"}));
  diracstep_facts facts{};
  ASSERT_EQ(diracstep_read_facts(model_, &facts), DIRACSTEP_OK);
  EXPECT_EQ(facts.outputs, 2);

  const double first = std::sqrt(2.0 / 9.81), second = 1.5 * first;  // e = 1/2: up takes half as long
  ASSERT_EQ(create(), DIRACSTEP_OK) << diracstep_message();
  Arrays arrays(2, 1);
  std::vector<double> outputs(2 * 400);
  arrays.resize(400);
  arrays.points.outputs = outputs.data();
  ASSERT_EQ(diracstep_run(made_, nullptr, &arrays.points), DIRACSTEP_OK) << diracstep_message();
  ASSERT_EQ(diracstep_count_events(made_), 2);  // the floor and the end
  diracstep_event event{};
  ASSERT_EQ(diracstep_read_event(made_, 0, &event), DIRACSTEP_OK);
  EXPECT_STREQ(event.name, "floor");
  EXPECT_NEAR(event.time, first, 1e-12);
  EXPECT_NEAR(event.impulse, 1.5 * 9.81 * first, 1e-10);
  ASSERT_NE(event.after_v, nullptr);
  EXPECT_NEAR(event.after_v[0], -0.5 * event.v[0], 1e-10);
  ASSERT_EQ(diracstep_read_event(made_, 1, &event), DIRACSTEP_OK);
  EXPECT_STREQ(event.name, "top");
  EXPECT_NEAR(event.time, second, 1e-12);
  EXPECT_TRUE(std::isnan(event.impulse));
  EXPECT_EQ(event.after_v, nullptr);
  EXPECT_EQ(diracstep_read_event(made_, 3, &event), DIRACSTEP_MISUSE);
  diracstep_statistics statistics{};
  ASSERT_EQ(diracstep_read_statistics(made_, &statistics), DIRACSTEP_OK);
  EXPECT_EQ(statistics.stopped, 1);
  const auto last = static_cast<std::size_t>(arrays.points.count - 1);
  EXPECT_NEAR(arrays.t[last], second, 1e-12);
  EXPECT_EQ(diracstep_time(made_), arrays.t[last]);
  EXPECT_EQ(outputs[2 * last + 1], 2.0 * arrays.q[2 * last]);
  EXPECT_EQ(outputs[2 * 60], 1.0);  // after the first
  EXPECT_STREQ(diracstep_doubt(made_), "");
  EXPECT_EQ(diracstep_step(made_, 1), DIRACSTEP_MISUSE);
  expect_message({"ended the motion"});

  ASSERT_EQ(diracstep_reset(made_, 0.0, nullptr, nullptr), DIRACSTEP_OK) << diracstep_message();
  EXPECT_EQ(diracstep_count_events(made_), 0);
  std::vector<double> q(2), v(2), shown(2);
  diracstep_state state{};
  state.q = q.data();
  state.v = v.data();
  state.outputs = shown.data();
  for (long k = 0; k < 60; ++k) ASSERT_EQ(diracstep_step(made_, 1), DIRACSTEP_OK) << diracstep_message();
  ASSERT_EQ(diracstep_read(made_, DIRACSTEP_PROJECTED, &state), DIRACSTEP_OK);
  EXPECT_EQ(q[0], arrays.q[2 * 60]);
  EXPECT_EQ(shown[0], 1.0);
  std::size_t size = 0;
  ASSERT_EQ(diracstep_save(made_, nullptr, 0, &size), DIRACSTEP_OK) << diracstep_message();
  std::vector<char> bytes(size);
  ASSERT_EQ(diracstep_save(made_, bytes.data(), size, &size), DIRACSTEP_OK);
  ASSERT_EQ(diracstep_step(made_, 1000), DIRACSTEP_OK);  // ends at the event
  EXPECT_EQ(diracstep_time(made_), arrays.t[last]);
  ASSERT_EQ(diracstep_restore(made_, bytes.data(), size), DIRACSTEP_OK) << diracstep_message();
  ASSERT_EQ(diracstep_step(made_, 1000), DIRACSTEP_OK);
  EXPECT_EQ(diracstep_time(made_), arrays.t[last]);

  const double high[] = {2.0, 0.0}, still[] = {0.0, 0.0};
  ASSERT_EQ(diracstep_reset(made_, 0.0, high, still), DIRACSTEP_OK) << diracstep_message();
  ASSERT_EQ(diracstep_step(made_, 70), DIRACSTEP_OK);
  ASSERT_EQ(diracstep_count_events(made_), 1);
  ASSERT_EQ(diracstep_read_event(made_, 0, &event), DIRACSTEP_OK);
  EXPECT_NEAR(event.time, std::sqrt(4.0 / 9.81), 1e-12);
}

TEST_F(CInterface, WhatDoesNotGoWithEventsIsRefused) {
  diracstep_source source{};
  source.text = ball;
  ASSERT_EQ(open(source), DIRACSTEP_OK);
  Arrays arrays(2, 1, 400);
  diracstep_error error{1e-6, 2, 0, 0.0};
  diracstep_found found{};
  EXPECT_EQ(diracstep_solve(model_, nullptr, nullptr, &error, &arrays.points, &found), DIRACSTEP_MISUSE);
  expect_message({"fixed size", "events"});
  ASSERT_EQ(create(), DIRACSTEP_OK);
  diracstep_derivatives derivatives{};
  derivatives.steps = 3;
  EXPECT_EQ(diracstep_differentiate(model_, made_, &derivatives), DIRACSTEP_MISUSE);
  expect_message({"events"});
}

/// Falls freely from 1 and bounces; what finds no room ends the run behind its step.
TEST_F(CInterface, TimesGoThroughEvents) {
  diracstep_source source{};
  source.text = ball;
  ASSERT_EQ(open(source), DIRACSTEP_OK);
  ASSERT_EQ(create(), DIRACSTEP_OK);
  const double falls = std::sqrt(2.0 / 9.81), times[] = {0.1, falls, 0.6};
  diracstep_course course{};
  course.times = 3;
  course.time = times;
  Arrays arrays(2, 1, 2);
  arrays.points.enlarge = nullptr;
  EXPECT_EQ(diracstep_run(made_, &course, &arrays.points), DIRACSTEP_FAILED);
  expect_message({"room for 2 points"});
  EXPECT_NEAR(arrays.q[0], 1.0 - 0.5 * 9.81 * 0.01, 1e-12);
  EXPECT_NEAR(arrays.q[2], 0.0, 1e-12);
  EXPECT_NEAR(arrays.v[0], -0.981, 1e-12);
  EXPECT_GT(arrays.v[2], 0.0) << "behind the impact";
  course.time = times + 1;
  course.times = 2;
  EXPECT_EQ(diracstep_run(made_, &course, &arrays.points), DIRACSTEP_MISUSE);
  expect_message({"does not lie ahead"});
}

/// y = 3 cos t - 2 to the floor, then up with half of the speed.
TEST_F(CInterface, ASearchForAnErrorGoesThroughEvents) {
  diracstep_source source{};
  source.text =
      "name = \"spring_ball\"\nlagrangian = \"v_y^2/2 - y^2/2 - 2*y\"\n[coordinates]\ny = {}\n[start]\ny = "
      "1\n"
      "[span]\nend = 3\nstep = 0.1\n[[events]]\nname = \"floor\"\nwhen = \"y\"\nrestitution = 0.5\n"
      "[[events]]\nname = \"top\"\nwhen = \"v_y\"\ndirection = \"falling\"\nif = \"t > 0.1\"\naction = "
      "\"stop\"\n";
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  Arrays arrays(1, 1);
  diracstep_error error{1e-9, 0, 0, 0.0};
  diracstep_found found{};
  ASSERT_EQ(diracstep_solve(model_, nullptr, nullptr, &error, &arrays.points, &found), DIRACSTEP_OK)
      << diracstep_message();
  const double first = std::acos(2.0 / 3.0), up = std::sqrt(5.0) / 2.0;  // its time, the speed after it
  const double last = first + std::atan(up / 2.0);
  EXPECT_LT(found.estimate, 1e-9);
  EXPECT_EQ(found.varies, 0);
  EXPECT_GE(found.runs.rows, 3);
  EXPECT_STREQ(found.warning, "");
  EXPECT_EQ(found.stopped, 1);
  ASSERT_EQ(found.events, 2);
  EXPECT_STREQ(found.event[0].name, "floor");
  EXPECT_NEAR(found.event[0].time, first, 3e-9);
  EXPECT_NEAR(found.event[0].after_v[0], up, 3e-9);
  EXPECT_NEAR(found.event[0].impulse, 1.5 * std::sqrt(5.0), 1e-8);
  EXPECT_STREQ(found.event[1].name, "top");
  EXPECT_EQ(found.event[1].after_q, nullptr);
  const auto end = static_cast<std::size_t>(arrays.points.count - 1);
  EXPECT_EQ(arrays.t[end], found.event[1].time);
  EXPECT_NEAR(arrays.t[end], last, 3e-9);
  EXPECT_NEAR(arrays.last_q(0), std::hypot(2.0, up) - 2.0, 3e-9);

  error.max_solves = 1;
  EXPECT_EQ(diracstep_solve(model_, nullptr, nullptr, &error, &arrays.points, &found), DIRACSTEP_FAILED);
  EXPECT_EQ(found.events, 0);
  const int stop = 1;
  diracstep_course course{};
  course.stop = &stop;
  error.max_solves = 0;
  EXPECT_EQ(diracstep_solve(model_, nullptr, &course, &error, &arrays.points, &found), DIRACSTEP_INTERRUPTED);
  expect_message({"interrupted"});
}

TEST_F(CInterface, EnsemblesGoThroughEventsAndAreLookedAt) {
  diracstep_source source{};
  source.text = ball;
  ASSERT_EQ(open(source), DIRACSTEP_OK);
  const double starts[] = {1.0, 0.0, 2.0, 0.0, 1e4, 0.0}, v[] = {0, 0, 0, 0, 0, 0};
  diracstep_ensemble ensemble{};
  ensemble.members = 3;
  ensemble.q = starts;
  ensemble.v = v;
  Arrays ends(2, 1, 3);
  diracstep_table told{};
  ASSERT_EQ(diracstep_run_ensemble(model_, nullptr, &ensemble, &ends.points, &told), DIRACSTEP_OK)
      << diracstep_message();
  EXPECT_NEAR(ends.t[0], 1.5 * std::sqrt(2.0 / 9.81), 1e-12);  // where it is stopped
  EXPECT_NEAR(ends.t[1], 1.5 * std::sqrt(4.0 / 9.81), 1e-12);
  EXPECT_EQ(ends.q[1], 1.0);
  EXPECT_NEAR(ends.t[2], 1.5, 1e-12);
  EXPECT_EQ(ends.q[5], 0.0);

  source.text =
      "name = \"stiff\"\nlagrangian = \"v_x^2/2 - 1e4*x^4/4\"\n[coordinates]\nx = {}\n[start]\nx = 1\n"
      "[span]\nend = 10\nstep = 0.025\n";
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  const double ones[] = {1.0, 1.0};
  ensemble.members = 2;
  ensemble.q = ones;
  ASSERT_EQ(diracstep_run_ensemble(model_, nullptr, &ensemble, &ends.points, &told), DIRACSTEP_OK);
  ASSERT_GE(told.rows, 1);
  EXPECT_STREQ(told.cells[1], "doubted");
}

}  // namespace
}  // namespace diracstep::testing
