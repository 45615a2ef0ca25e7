#include <diracstep/c_interface/diracstep.h>
#include <diracstep/version.h>

#include <cmath>
#include <law_scenes.hpp>

#include "callbacks.hpp"
#include "misuse.hpp"

namespace diracstep::testing {
namespace {

/// The C interface, from creation to failure.
class CInterface : public ::testing::Test {
 protected:
  ~CInterface() override { diracstep_destroy(made_); }
  int create(const diracstep_scene* scene, const diracstep_options* options = nullptr,
             unsigned version = DIRACSTEP_VERSION_OF_C_INTERFACE) {
    diracstep_destroy(made_);
    return diracstep_create(version, scene, options, &made_);
  }
  void expect_message(std::initializer_list<std::string> parts) const {
    expect_parts(diracstep_message(made_), parts);
  }
  diracstep_integrator* made_ = nullptr;
};

TEST_F(CInterface, StepsAndReadsAsTheLibraryDoes) {
  const auto scene = laws::mixed();
  AsCallbacks callbacks(scene);
  diracstep_options options{};
  options.method = "type1/gl:2";
  ASSERT_EQ(create(&callbacks.scene(), &options), DIRACSTEP_OK) << diracstep_message(made_);
  EXPECT_EQ(diracstep_step(made_, 20), DIRACSTEP_OK);
  Vector q(3), v(3), p(3), lambda(2);
  diracstep_state state{0.0, 0.0, q.data(), v.data(), p.data(), lambda.data()};
  ASSERT_EQ(diracstep_read(made_, DIRACSTEP_PROJECTED, &state), DIRACSTEP_OK);
  const Sample expected = end_of(scene, "type1/gl:2");
  EXPECT_DOUBLE_EQ(state.time, 1.0);
  EXPECT_NEAR(state.energy, expected.energy, 1e-9);
  EXPECT_LT((q - expected.q).lpNorm<Eigen::Infinity>(), 1e-9);
  EXPECT_LT((v - expected.v).lpNorm<Eigen::Infinity>(), 1e-9);
  EXPECT_LT((p - expected.p).lpNorm<Eigen::Infinity>(), 1e-9);
  EXPECT_LT((lambda - expected.lambda).lpNorm<Eigen::Infinity>(), 1e-7);
  EXPECT_EQ(diracstep_reset(made_, 0.0, nullptr, nullptr), DIRACSTEP_OK);
  ASSERT_EQ(diracstep_read(made_, DIRACSTEP_MINUS, &state), DIRACSTEP_OK);
  EXPECT_EQ(q, scene->start.q);
}

TEST_F(CInterface, HeaderAndLibraryHaveOneVersion) { EXPECT_STREQ(diracstep_version(), DIRACSTEP_VERSION); }

TEST_F(CInterface, MisuseIsToldAndNothingElse) {
  AsCallbacks callbacks(laws::mixed());
  EXPECT_EQ(create(nullptr), DIRACSTEP_MISUSE);
  expect_message({"scene is NULL"});
  EXPECT_EQ(diracstep_step(made_, 1), DIRACSTEP_MISUSE);
  expect_message({"no integrator"});
  EXPECT_EQ(create(&callbacks.scene(), nullptr, 77), DIRACSTEP_MISUSE);
  expect_message({"version 77", std::to_string(DIRACSTEP_VERSION_OF_C_INTERFACE)});
  diracstep_options options{};
  options.method = "type9/none";
  EXPECT_EQ(create(&callbacks.scene(), &options), DIRACSTEP_MISUSE);
  expect_message({"type9/none", "type1/midpoint"});
  const char* plugin = "missing.so";
  options = {};
  options.plugins = 1;
  options.plugin = &plugin;
  EXPECT_EQ(create(&callbacks.scene(), &options), DIRACSTEP_MISUSE);
  expect_message({"missing.so"});
  EXPECT_EQ(create(&callbacks.scene()), DIRACSTEP_OK);
  EXPECT_EQ(diracstep_read(made_, 5, nullptr), DIRACSTEP_MISUSE);
  EXPECT_EQ(diracstep_step(made_, -1), DIRACSTEP_MISUSE);
  EXPECT_EQ(diracstep_step(nullptr, 1), DIRACSTEP_MISUSE);
}

TEST_F(CInterface, TakesMethodsOfPlugins) {
  AsCallbacks callbacks(laws::unconstrained());
  const char* plugin = DIRACSTEP_TEST_PLUGINS "/galerkin.so";
  diracstep_options options{};
  options.method = "type1/galerkin2";
  options.plugins = 1;
  options.plugin = &plugin;
  EXPECT_EQ(create(&callbacks.scene(), &options), DIRACSTEP_OK) << diracstep_message(made_);
  EXPECT_EQ(diracstep_step(made_, 3), DIRACSTEP_OK) << diracstep_message(made_);
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
  ASSERT_EQ(create(&callbacks.scene()), DIRACSTEP_OK) << diracstep_message(made_);
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
    ASSERT_EQ(create(&scene, &options), DIRACSTEP_OK) << diracstep_message(made_);
    ASSERT_EQ(diracstep_step(made_, 100), DIRACSTEP_OK) << diracstep_message(made_);
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
  ASSERT_EQ(create(&scene), DIRACSTEP_OK) << diracstep_message(made_);
  (void)diracstep_step(made_, 3);
  EXPECT_NE(std::string(diracstep_doubt(made_)).find("differences"), std::string::npos);
}

}  // namespace
}  // namespace diracstep::testing
