#include <array>
#include <cmath>
#include <numbers>

#include "c_interface.hpp"

namespace diracstep::testing {
namespace {

/// A rotation is stored in four numbers and moves by three.
TEST_F(CInterface, PlacesOnGroupsHaveMoreNumbersThanVelocities) {
  ASSERT_EQ(open("heavy_top_so3"), DIRACSTEP_OK) << diracstep_message();
  diracstep_facts facts{};
  ASSERT_EQ(diracstep_read_facts(model_, &facts), DIRACSTEP_OK);
  EXPECT_EQ(facts.dimension, 3);
  EXPECT_EQ(facts.storage, 4);
  EXPECT_EQ(facts.start_q[0], 1.0);
  EXPECT_EQ(listed(DIRACSTEP_POSITIONS), (std::vector<std::string>{"R_w", "R_x", "R_y", "R_z"}));
  ASSERT_EQ(create(), DIRACSTEP_OK) << diracstep_message();
  ASSERT_EQ(diracstep_step(made_, 2), DIRACSTEP_OK) << diracstep_message();
  std::array<double, 5> q{0, 0, 0, 0, -7};
  std::array<double, 4> v{0, 0, 0, -7};
  diracstep_state state{};
  state.q = q.data();
  state.v = v.data();
  ASSERT_EQ(diracstep_read(made_, DIRACSTEP_PROJECTED, &state), DIRACSTEP_OK);
  EXPECT_NEAR(std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3])), 1.0, 1e-14);
  EXPECT_EQ(q[4], -7);
  EXPECT_EQ(v[3], -7);
  const std::array<double, 8> starts{1, 0, 0, 0, std::numbers::sqrt2 / 2, 0, 0, std::numbers::sqrt2 / 2};
  diracstep_ensemble ensemble{};
  ensemble.members = 2;
  ensemble.q = starts.data();
  ensemble.steps = 2;
  ensemble.threads = 1;
  std::array<double, 8> ends{};
  std::array<double, 6> rates{};
  diracstep_points points{};
  points.room = 2;
  points.q = ends.data();
  points.v = rates.data();
  ASSERT_EQ(diracstep_run_ensemble(model_, nullptr, &ensemble, &points, nullptr), DIRACSTEP_OK)
      << diracstep_message();
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(ends[i], q[i]);
  for (std::size_t i = 0; i < 3; ++i)  // turned about the vertical: the same rates in the body
    EXPECT_NEAR(rates[3 + i], v[i], 1e-9 * 150);
}

TEST_F(CInterface, FindsAnEquilibriumAndItsModes) {
  diracstep_source source{};
  source.text =
      "name = \"two\"\nlagrangian = \"(v_x^2 + 4*v_y^2)/2 - (x - 1)^2/2 - 8*y^2\"\n[coordinates]\nx = {}\ny "
      "= "
      "{}\n[start]\nx = 0.5\n[span]\nend = 1\nstep = 0.1\n";
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  diracstep_equilibrium found{};
  ASSERT_EQ(diracstep_find_equilibrium(model_, nullptr, &found), DIRACSTEP_OK) << diracstep_message();
  EXPECT_NEAR(found.q[0], 1.0, 1e-12);
  EXPECT_EQ(found.lambda, nullptr);
  ASSERT_EQ(found.modes, 2);
  EXPECT_NEAR(found.eigenvalue[1], 1.0, 1e-12);
  EXPECT_NEAR(found.eigenvalue[3], 2.0, 1e-12);
  EXPECT_NEAR(found.shape[2 * 2 + 2], 1.0, 1e-12);  // the second moves y
  EXPECT_NEAR(found.mass[0] + found.mass[3], 5.0, 1e-12);
  EXPECT_TRUE(std::isnan(found.near));
  EXPECT_EQ(found.free_directions, 0);
  EXPECT_STREQ(found.doubt, "");
  diracstep_rest rest{};
  rest.modes = 2000;
  EXPECT_EQ(diracstep_find_equilibrium(model_, &rest, &found), DIRACSTEP_MISUSE);
  expect_message({"modes is 2000", "1000"});
  ASSERT_EQ(open("knife_edge"), DIRACSTEP_OK);
  EXPECT_EQ(diracstep_find_equilibrium(model_, nullptr, &found), DIRACSTEP_FAILED);
  expect_message({"no equilibrium"});
  EXPECT_NE(found.q, nullptr);
}

/// A pendulum of length 1 whose height is a guess, held at x = 0.6: g sin and the force that carries it.
TEST_F(CInterface, SolvesAStart) {
  diracstep_source source{};
  source.text =
      "name = \"rod\"\nlagrangian = \"(v_x^2 + v_y^2)/2 - 10*y\"\n[coordinates]\nx = {}\ny = {}\n"
      "[[rows]]\nname = \"rod\"\nequation = \"x^2/2 + y^2/2 = 0.5\"\n[start]\nx = 0.6\ny = -0.7\n"
      "guess = [\"y\"]\n[span]\nend = 1\nstep = 0.1\n";
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  std::array<double, 2> q{}, a{};
  double lambda = 0.0;
  diracstep_state state{};
  state.q = q.data();
  state.lambda = &lambda;
  diracstep_table origins{};
  ASSERT_EQ(diracstep_solve_start(model_, &state, a.data(), &origins), DIRACSTEP_OK) << diracstep_message();
  EXPECT_NEAR(q[1], -0.8, 1e-12);
  EXPECT_NEAR(state.energy, -8.0, 1e-11);
  EXPECT_NEAR(a[0], -4.8, 1e-11);
  EXPECT_NEAR(a[1], -3.6, 1e-11);
  EXPECT_NEAR(std::abs(lambda), 8.0, 1e-11);
  ASSERT_EQ(origins.rows, 4);
  EXPECT_STREQ(origins.cells[3], "y");
  EXPECT_STREQ(origins.cells[4], "guess");
  EXPECT_EQ(std::stod(origins.cells[5]), -0.7);
}

/// x = cos(2t), exact numbers: k = 4 is found from 3, and what is not measured does not count.
TEST_F(CInterface, FitsAParameterToData) {
  diracstep_source source{};
  source.text =
      "name = \"spring\"\nlagrangian = \"v_x^2/2 - k*x^2/2\"\n[coordinates]\nx = {}\n[parameters]\n"
      "k = { value = 3 }\n[start]\nx = 1\n[span]\nend = 2\nstep = 0.05\n";
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  const std::array<double, 4> times{0.3, 0.6, 0.9, 1.2};
  std::array<double, 4> values{};
  for (std::size_t k = 0; k < 4; ++k) values[k] = std::cos(2.0 * times[k]);
  values[2] = std::nan("");
  const char *const column = "x", *const parameter = "k";
  diracstep_data data{};
  data.columns = 1;
  data.column = &column;
  data.rows = 4;
  data.time = times.data();
  data.value = values.data();
  data.parameters = 1;
  data.parameter = &parameter;
  diracstep_fitted found{};
  ASSERT_EQ(diracstep_fit(model_, nullptr, &data, &found), DIRACSTEP_OK) << diracstep_message();
  EXPECT_NEAR(found.value[0], 4.0, 1e-8);
  EXPECT_EQ(found.measured, 3);
  EXPECT_LT(found.interval[0], 1e-6);
  EXPECT_STREQ(found.doubt, "");
  const int stop = 1;
  data.stop = &stop;
  EXPECT_EQ(diracstep_fit(model_, nullptr, &data, &found), DIRACSTEP_INTERRUPTED);
  data.stop = nullptr;
  data.confidence = 95;
  EXPECT_EQ(diracstep_fit(model_, nullptr, &data, &found), DIRACSTEP_MISUSE);
  expect_message({"confidence is 95"});
}

}  // namespace
}  // namespace diracstep::testing
