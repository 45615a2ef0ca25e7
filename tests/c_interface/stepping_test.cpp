#include <cmath>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <law_scenes.hpp>

#include "c_interface.hpp"
#include "callbacks.hpp"

namespace diracstep::testing {
namespace {

TEST_F(CInterface, StepsAndReadsAsTheLibraryDoes) {
  const auto scene = laws::mixed();
  AsCallbacks callbacks(scene);
  diracstep_options options{};
  options.method = "type1/gl:2";
  ASSERT_EQ(create(&callbacks.scene(), options), DIRACSTEP_OK) << diracstep_message();
  EXPECT_EQ(diracstep_step(made_, 20), DIRACSTEP_OK);
  Vector q(3), v(3), p(3), lambda(2);
  diracstep_state state{0.0, 0.0, q.data(), v.data(), p.data(), lambda.data(), nullptr, nullptr};
  ASSERT_EQ(diracstep_read(made_, DIRACSTEP_PROJECTED, &state), DIRACSTEP_OK);
  const Sample expected = end_of(scene, "type1/gl:2");
  EXPECT_DOUBLE_EQ(state.time, 1.0);
  EXPECT_DOUBLE_EQ(diracstep_time(made_), 1.0);
  EXPECT_NEAR(state.energy, expected.energy, 1e-9);
  EXPECT_LT((q - expected.q).lpNorm<Eigen::Infinity>(), 1e-9);
  EXPECT_LT((v - expected.v).lpNorm<Eigen::Infinity>(), 1e-9);
  EXPECT_LT((p - expected.p).lpNorm<Eigen::Infinity>(), 1e-9);
  EXPECT_LT((lambda - expected.lambda).lpNorm<Eigen::Infinity>(), 1e-7);
  EXPECT_EQ(diracstep_reset(made_, 0.0, nullptr, nullptr), DIRACSTEP_OK);
  ASSERT_EQ(diracstep_read(made_, DIRACSTEP_MINUS, &state), DIRACSTEP_OK);
  EXPECT_EQ(q, scene->start.q);
}

TEST_F(CInterface, ASnapshotGoesOnWithTheSameBits) {
  ASSERT_EQ(open("knife_edge"), DIRACSTEP_OK);
  ASSERT_EQ(create(), DIRACSTEP_OK);
  ASSERT_EQ(diracstep_step(made_, 7), DIRACSTEP_OK);
  std::size_t size = 0;
  ASSERT_EQ(diracstep_save(made_, nullptr, 0, &size), DIRACSTEP_OK);
  std::string bytes(size, '\0');
  ASSERT_EQ(diracstep_save(made_, bytes.data(), bytes.size(), &size), DIRACSTEP_OK);
  const auto position = [&] {
    double q[3];
    diracstep_state state{};
    state.q = q;
    EXPECT_EQ(diracstep_step(made_, 5), DIRACSTEP_OK);
    EXPECT_EQ(diracstep_read(made_, DIRACSTEP_PROJECTED, &state), DIRACSTEP_OK);
    return q[0];
  };
  const double first = position();
  ASSERT_EQ(diracstep_restore(made_, bytes.data(), bytes.size()), DIRACSTEP_OK) << diracstep_message();
  EXPECT_EQ(position(), first);
  EXPECT_EQ(diracstep_restore(made_, "nothing", 7), DIRACSTEP_MISUSE);
}

TEST_F(CInterface, APushActsLikeAForce) {
  diracstep_source source{};
  source.text =
      "name = \"free\"\nlagrangian = \"v_x^2\"\n[coordinates]\nx = {}\n[span]\nend = 1.0\nstep = 0.5\n";
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  const double force[] = {3.0};
  ASSERT_EQ(create(), DIRACSTEP_OK);
  EXPECT_EQ(diracstep_push(made_, force), DIRACSTEP_MISUSE);
  diracstep_options options{};
  options.pushed = 1;
  ASSERT_EQ(create(options), DIRACSTEP_OK) << diracstep_message();
  double q[1];
  diracstep_state state{};
  state.q = q;
  ASSERT_EQ(diracstep_step(made_, 2), DIRACSTEP_OK);
  ASSERT_EQ(diracstep_read(made_, DIRACSTEP_PROJECTED, &state), DIRACSTEP_OK);
  EXPECT_EQ(q[0], 0.0);
  ASSERT_EQ(diracstep_push(made_, force), DIRACSTEP_OK);
  ASSERT_EQ(diracstep_step(made_, 2), DIRACSTEP_OK) << diracstep_message();
  ASSERT_EQ(diracstep_read(made_, DIRACSTEP_PROJECTED, &state), DIRACSTEP_OK);
  EXPECT_NEAR(q[0], 0.75, 1e-13);  // x'' = 3/2 for one unit of time
  const double nothing[] = {std::nan("")};
  EXPECT_EQ(diracstep_push(made_, nothing), DIRACSTEP_MISUSE);
}

TEST_F(CInterface, WithoutAMethodWhatTheFileRecommendsIsTaken) {
  ASSERT_EQ(open("knife_edge"), DIRACSTEP_OK);
  const Recommendation advice = make_scene("knife_edge").recommended;
  ASSERT_TRUE(advice.stated);
  ASSERT_EQ(create(), DIRACSTEP_OK);
  diracstep_statistics statistics{};
  ASSERT_EQ(diracstep_read_statistics(made_, &statistics), DIRACSTEP_OK);
  EXPECT_EQ(statistics.step, advice.step);
  diracstep_table plan{};
  ASSERT_EQ(diracstep_plan(made_, &plan), DIRACSTEP_OK);
  std::string all;
  for (int k = 0; k < plan.rows * plan.columns; ++k) all += plan.cells[k];
  EXPECT_NE(all.find("the scene's file recommends it"), std::string::npos);
}

TEST_F(CInterface, ThePlanTellsWhetherVariableStepsPay) {
  const auto decision = [&](const char* scene) {
    EXPECT_EQ(open(scene), DIRACSTEP_OK);
    EXPECT_EQ(create(), DIRACSTEP_OK);
    diracstep_table plan{};
    EXPECT_EQ(diracstep_plan(made_, &plan), DIRACSTEP_OK);
    for (int k = 0; k < plan.rows; ++k)
      if (std::string(plan.cells[3 * k]) == "variable steps") return std::string(plan.cells[3 * k + 1]);
    return std::string("no line");
  };
  EXPECT_EQ(decision("kepler_e099"), "save time: eps");
  EXPECT_EQ(decision("pendulum_cartesian"), "left out");
}

TEST_F(CInterface, StepsByHandAreDoubtedAsRunsAre) {
  diracstep_source source{};
  source.text =
      "name = \"stiff\"\nlagrangian = \"v_x^2/2 - 1e4*x^4/4\"\n[coordinates]\nx = {}\n[start]\nx = 1\n"
      "[span]\nend = 10\nstep = 0.025\n";
  ASSERT_EQ(open(source), DIRACSTEP_OK);
  for (const bool is_pushed : {false, true}) {
    diracstep_options options{};
    options.pushed = is_pushed ? 1 : 0;
    ASSERT_EQ(create(options), DIRACSTEP_OK) << diracstep_message();
    EXPECT_STREQ(diracstep_doubt(made_), "");
    ASSERT_EQ(diracstep_step(made_, 400), DIRACSTEP_OK) << diracstep_message();
    EXPECT_STRNE(diracstep_doubt(made_), "") << is_pushed;
    ASSERT_EQ(diracstep_reset(made_, 0.0, nullptr, nullptr), DIRACSTEP_OK);
    EXPECT_STREQ(diracstep_doubt(made_), "");
  }
  source.text = spring;
  ASSERT_EQ(open(source), DIRACSTEP_OK);
  ASSERT_EQ(create(), DIRACSTEP_OK);
  ASSERT_EQ(diracstep_step(made_, 60), DIRACSTEP_OK);
  EXPECT_STREQ(diracstep_doubt(made_), "");
}

/// A current behind 1 mH and 1 kOhm: without options the steps vary, as those of the command do.
TEST_F(CInterface, WhatIsLeftOpenIsChosenForTheMotion) {
  diracstep_source source{};
  source.text =
      "name = \"load\"\nlagrangian = \"1e-3*v_q^2/2\"\n[coordinates]\nq = {}\n"
      "[force]\nq = \"5 + sin(100*pi*t) - 1000*v_q\"\n[span]\nend = 0.013\nstep = 5e-4\n";
  ASSERT_EQ(open(source), DIRACSTEP_OK);
  const auto step_size = [this](const diracstep_options& options) {
    EXPECT_EQ(create(options), DIRACSTEP_OK) << diracstep_message();
    diracstep_statistics statistics{};
    EXPECT_EQ(diracstep_read_statistics(made_, &statistics), DIRACSTEP_OK);
    EXPECT_STREQ(statistics.method, "damped/radau:3");
    return statistics.step;
  };
  EXPECT_EQ(step_size({}), 0.0);  // they vary
  diracstep_options options{};
  options.fixed = 1;
  EXPECT_EQ(step_size(options), 5e-4);
  options = {};
  options.step = 1e-4;
  EXPECT_EQ(step_size(options), 1e-4);
}

}  // namespace
}  // namespace diracstep::testing
