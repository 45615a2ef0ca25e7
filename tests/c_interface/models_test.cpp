#include <array>
#include <cmath>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <law_scenes.hpp>

#include "c_interface.hpp"
#include "callbacks.hpp"

namespace diracstep::testing {
namespace {

TEST_F(CInterface, HeaderAndLibraryHaveOneVersion) { EXPECT_STREQ(diracstep_version(), DIRACSTEP_VERSION); }

TEST_F(CInterface, MisuseIsToldAndNothingElse) {
  AsCallbacks callbacks(laws::mixed());
  EXPECT_EQ(diracstep_open(DIRACSTEP_VERSION_OF_C_INTERFACE, nullptr, &model_), DIRACSTEP_MISUSE);
  expect_message({"source is NULL"});
  EXPECT_EQ(diracstep_step(made_, 1), DIRACSTEP_MISUSE);
  expect_message({"integrator is NULL"});
  EXPECT_EQ(open({}, 77), DIRACSTEP_MISUSE);
  EXPECT_EQ(model_, nullptr);
  expect_message({"version 77", std::to_string(DIRACSTEP_VERSION_OF_C_INTERFACE)});
  diracstep_options options{};
  options.method = "type9/none";
  EXPECT_EQ(create(&callbacks.scene(), options), DIRACSTEP_MISUSE);
  EXPECT_EQ(made_, nullptr);
  expect_message({"type9/none", "type1/midpoint"});
  const char* plugin = "missing.so";
  diracstep_source source{};
  source.plugins = 1;
  source.plugin = &plugin;
  EXPECT_EQ(open(source), DIRACSTEP_MISUSE);
  expect_message({"missing.so"});
  EXPECT_EQ(create(&callbacks.scene()), DIRACSTEP_OK);
  EXPECT_EQ(diracstep_read(made_, 5, nullptr), DIRACSTEP_MISUSE);
  EXPECT_EQ(diracstep_step(made_, -1), DIRACSTEP_MISUSE);
  EXPECT_EQ(open("no_such_scene"), DIRACSTEP_MISUSE);
  expect_message({"no_such_scene", "knife_edge"});
}

TEST_F(CInterface, TakesMethodsOfPlugins) {
  AsCallbacks callbacks(laws::unconstrained());
  const char* plugin = DIRACSTEP_TEST_PLUGINS "/galerkin.so";
  diracstep_source source{};
  source.callbacks = &callbacks.scene();
  source.plugins = 1;
  source.plugin = &plugin;
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  diracstep_options options{};
  options.method = "type1/galerkin2";
  EXPECT_EQ(create(options), DIRACSTEP_OK) << diracstep_message();
  EXPECT_EQ(diracstep_step(made_, 3), DIRACSTEP_OK) << diracstep_message();
  EXPECT_TRUE(has(listed(DIRACSTEP_METHODS), "type1/galerkin2"));
  EXPECT_EQ(listed(DIRACSTEP_PLUGINS, 1), std::vector<std::string>{plugin});
}

TEST_F(CInterface, AnErrorOfACallbackIsAFailureAndKeepsTheState) {
  AsCallbacks callbacks(laws::unconstrained());
  static const diracstep_function* inner = nullptr;
  static diracstep_function whole{};
  whole = callbacks.lagrangian();
  inner = &whole;
  callbacks.lagrangian().value = [](const void* data, double t, const double* x, const double* y, double* f) {
    return t > 0.2 ? 9 : inner->value(data, t, x, y, f);
  };
  ASSERT_EQ(create(&callbacks.scene()), DIRACSTEP_OK) << diracstep_message();
  EXPECT_EQ(diracstep_step(made_, 10), DIRACSTEP_FAILED);
  expect_message({"scene 'callbacks'", "lagrangian.value returned error 9"});
}

/// A particle on a spring of rest length l in the plane, its Lagrangian alone: one problem in three units.
TEST_F(CInterface, TheUnitOfLengthDoesNotCount) {
  Vector in_metres;
  for (const double l : {1.0, 1e-2, 1e-3, 1e6}) {
    diracstep_function lagrangian{};
    lagrangian.data = &l;
    lagrangian.value = [](const void* data, double, const double* x, const double* v, double* f) {
      const double stretch = std::hypot(x[0], x[1]) - *static_cast<const double*>(data);
      *f = 0.5 * (v[0] * v[0] + v[1] * v[1]) - 50.0 * stretch * stretch;
      return 0;
    };
    const double q0[] = {1.1 * l, 0.0}, v0[] = {0.0, l};
    diracstep_scene scene{};
    scene.name = "spring";
    scene.dimension = 2;
    scene.lagrangian = &lagrangian;
    scene.start_q = q0;
    scene.start_v = v0;
    scene.end_time = 5.0;
    scene.step = 0.05;
    diracstep_options options{};
    options.method = "type1/gl:3";
    ASSERT_EQ(create(&scene, options), DIRACSTEP_OK) << diracstep_message();
    ASSERT_EQ(diracstep_step(made_, 100), DIRACSTEP_OK) << diracstep_message();
    Vector q(2);
    diracstep_state state{};
    state.q = q.data();
    ASSERT_EQ(diracstep_read(made_, DIRACSTEP_PROJECTED, &state), DIRACSTEP_OK);
    q /= l;
    if (in_metres.size() == 0) in_metres = q;
    EXPECT_LT((q - in_metres).lpNorm<Eigen::Infinity>(), 1e-8) << l;
    EXPECT_NEAR(state.energy / (l * l), 1.0, 1e-5) << l;
    EXPECT_STREQ(diracstep_doubt(made_), "");
  }
}

/// The motion is that of a force of 1e-3; the constant beside it leaves nothing of it in differences.
TEST_F(CInterface, DifferencesLostInRoundOffAreDoubted) {
  diracstep_function lagrangian{};
  lagrangian.value = [](const void*, double, const double* x, const double* v, double* f) {
    *f = 0.5 * v[0] * v[0] - 1e-3 * std::sin(x[0]) + 1e11;
    return 0;
  };
  const double q0[] = {0.3}, v0[] = {0.0};
  diracstep_scene scene{};
  scene.dimension = 1;
  scene.lagrangian = &lagrangian;
  scene.start_q = q0;
  scene.start_v = v0;
  scene.end_time = 1.0;
  scene.step = 0.1;
  ASSERT_EQ(create(&scene), DIRACSTEP_OK) << diracstep_message();
  (void)diracstep_step(made_, 3);
  EXPECT_NE(std::string(diracstep_doubt(made_)).find("differences"), std::string::npos);
}

TEST_F(CInterface, KnowsTheCatalogueAndWhatASceneSays) {
  ASSERT_EQ(open(diracstep_source{}), DIRACSTEP_OK);
  EXPECT_EQ(listed(DIRACSTEP_SCENES), scene_names());
  EXPECT_TRUE(has(listed(DIRACSTEP_METHODS), "type1/midpoint"));
  EXPECT_TRUE(has(listed(DIRACSTEP_RULES), "trapezoidal"));
  diracstep_facts facts{};
  EXPECT_EQ(diracstep_read_facts(model_, &facts), DIRACSTEP_MISUSE);
  expect_message({"without a scene"});
  const diracstep_parameter g{"g_sin_alpha", 0.5};
  diracstep_source source{};
  source.name = "knife_edge";
  source.parameters = 1;
  source.parameter = &g;
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  ASSERT_EQ(diracstep_read_facts(model_, &facts), DIRACSTEP_OK);
  EXPECT_EQ(facts.dimension, 3);
  EXPECT_EQ(facts.rows, 1);
  EXPECT_EQ(facts.start_v[2], 1.0);
  EXPECT_EQ(listed(DIRACSTEP_COORDINATES), (std::vector<std::string>{"x", "y", "ph"}));
  EXPECT_EQ(listed(DIRACSTEP_COORDINATES, 1)[2], "rad");
  const auto values = listed(DIRACSTEP_PARAMETERS, 1);
  EXPECT_TRUE(has(values, "0.5"));
  EXPECT_EQ(diracstep_list(model_, 99, nullptr), DIRACSTEP_MISUSE);
  const diracstep_parameter wrong{"gravity", 1.0};
  source.parameter = &wrong;
  EXPECT_EQ(open(source), DIRACSTEP_MISUSE);
  expect_message({"gravity", "knife_edge"});
}

TEST_F(CInterface, ReadsASceneFromTextAndNamesWhereItIsWrong) {
  diracstep_source source{};
  source.text = spring;
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  EXPECT_EQ(listed(DIRACSTEP_INVARIANTS), std::vector<std::string>{"total"});
  source.text =
      "name = \"spring\"\nlagrangian = \"v_x^2/2 - y\"\n[coordinates]\nx = {}\n[span]\nend = 1.0\nstep = "
      "0.1\n";
  source.name = "mine.toml";
  EXPECT_EQ(open(source), DIRACSTEP_MISUSE);
  expect_message({"mine.toml:2", "y"});
}

/// A motion of 1e-9 beside one of 1e10, which sets what round-off is where L is not quadratic.
TEST_F(CInterface, ToleranceOfASmallCoordinateIsKept) {
  diracstep_source source{};
  const std::string text =
      "name = \"small\"\nlagrangian = \"v_x^2/2 + a^2*cos(x/a) + v_y^2/2\"\n[coordinates]\nx = {}\ny = {}\n"
      "[parameters]\na = 1e-9\nu = 0\n[start]\nx = \"a\"\nv_y = \"u\"\n[span]\nend = 10\nstep = 0.1\n";
  source.text = text.c_str();
  const auto end_of_x = [&] {
    EXPECT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
    EXPECT_EQ(create(), DIRACSTEP_OK) << diracstep_message();
    EXPECT_EQ(diracstep_step(made_, 100), DIRACSTEP_OK) << diracstep_message();
    std::array<double, 2> q{}, v{}, p{};
    diracstep_state state{0.0, 0.0, q.data(), v.data(), p.data(), nullptr, nullptr, nullptr};
    EXPECT_EQ(diracstep_read(made_, DIRACSTEP_PROJECTED, &state), DIRACSTEP_OK);
    return q[0];
  };
  const double alone = end_of_x();
  const diracstep_parameter speed{"u", 1e9};
  source.parameters = 1;
  source.parameter = &speed;
  EXPECT_GT(std::abs(end_of_x() - alone), 1e-10);
  diracstep_parameter tolerance{"x", 1e-24};
  source.tolerances = 1;
  source.tolerance = &tolerance;
  EXPECT_NEAR(end_of_x(), alone, 1e-18);
  tolerance.name = "z";
  EXPECT_EQ(open(source), DIRACSTEP_MISUSE);
  expect_message({"no coordinate 'z'"});
}

}  // namespace
}  // namespace diracstep::testing
