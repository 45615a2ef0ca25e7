#include <diracstep/c_interface/diracstep.h>
#include <diracstep/version.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <law_scenes.hpp>
#include <thread>

#include "callbacks.hpp"
#include "misuse.hpp"

namespace diracstep::testing {
namespace {

/// The C interface, from a source to points.
class CInterface : public ::testing::Test {
 protected:
  ~CInterface() override { forget(); }
  void forget() {
    diracstep_destroy(made_);
    diracstep_close(model_);
    made_ = nullptr;
    model_ = nullptr;
  }
  int open(const diracstep_source& source, unsigned version = DIRACSTEP_VERSION_OF_C_INTERFACE) {
    forget();
    return diracstep_open(version, &source, &model_);
  }
  int open(const char* name) {
    diracstep_source source{};
    source.name = name;
    return open(source);
  }
  int create(const diracstep_options& options = {}) {
    diracstep_destroy(made_);
    return diracstep_create(model_, &options, &made_);
  }
  int create(const diracstep_scene* scene, const diracstep_options& options = {}) {
    diracstep_source source{};
    source.callbacks = scene;
    const int status = open(source);
    return status == DIRACSTEP_OK ? create(options) : status;
  }
  static void expect_message(std::initializer_list<std::string> parts) {
    expect_parts(diracstep_message(), parts);
  }
  std::vector<std::string> listed(int what, int column = 0) {
    diracstep_table table{};
    EXPECT_EQ(diracstep_list(model_, what, &table), DIRACSTEP_OK) << diracstep_message();
    std::vector<std::string> texts;
    for (int r = 0; r < table.rows; ++r) texts.emplace_back(table.cells[r * table.columns + column]);
    return texts;
  }
  static bool has(const std::vector<std::string>& texts, const std::string& text) {
    return std::ranges::find(texts, text) != texts.end();
  }
  diracstep_model* model_ = nullptr;
  diracstep_integrator* made_ = nullptr;
};

/// Arrays that grow, for scenes of n coordinates and m rows.
struct Arrays {
  Arrays(int n, int m, long room = 4) : n_(n), m_(m) {
    points.data = this;
    points.enlarge = [](void* data, diracstep_points* into) {
      static_cast<Arrays*>(data)->resize(2 * into->room);
      return 0;
    };
    resize(room);
  }
  void resize(long room) {
    const auto rows = static_cast<std::size_t>(room);
    t.resize(rows);
    energy.resize(rows);
    q.resize(rows * static_cast<std::size_t>(n_));
    v.resize(q.size());
    lambda.resize(rows * static_cast<std::size_t>(m_));
    points.room = room;
    points.t = t.data();
    points.energy = energy.data();
    points.q = q.data();
    points.v = v.data();
    points.lambda = lambda.data();
  }
  double last_q(int i) const { return q[static_cast<std::size_t>((points.count - 1) * n_ + i)]; }

  int n_, m_;
  diracstep_points points{};
  std::vector<double> t, q, v, lambda, energy;
};

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

const char* const spring =
    "name = \"spring\"\nlagrangian = \"v_x^2/2 - x^2/2\"\n[coordinates]\nx = {}\n[start]\nx = 1\n"
    "[invariants]\ntotal = \"v_x^2/2 + x^2/2\"\n[span]\nend = 6.0\nstep = 0.25\n";

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

TEST_F(CInterface, RunsIntoArraysThatGrowAndEndsWhereAsked) {
  ASSERT_EQ(open("knife_edge"), DIRACSTEP_OK);
  diracstep_options options{};
  options.method = "type1/gl:2";
  options.step = 0.03;
  options.ends = 1;
  options.end = 2.0;
  ASSERT_EQ(create(options), DIRACSTEP_OK) << diracstep_message();
  Arrays arrays(3, 1);
  diracstep_course course{};
  course.every = 10;
  EXPECT_GE(diracstep_expect(made_, &course), 8);
  ASSERT_EQ(diracstep_run(made_, &course, &arrays.points), DIRACSTEP_OK) << diracstep_message();
  ASSERT_EQ(arrays.points.count, 8);  // 67 steps: 0, 10, … 60 and the end
  EXPECT_DOUBLE_EQ(arrays.t[7], 2.0);
  EXPECT_STREQ(diracstep_doubt(made_), "");
  diracstep_statistics statistics{};
  ASSERT_EQ(diracstep_read_statistics(made_, &statistics), DIRACSTEP_OK);
  EXPECT_EQ(statistics.steps, 67);
  EXPECT_STREQ(statistics.method, "type1/gl:2");

  const CatalogueScene entry = make_scene("knife_edge");
  Integrator same(entry.scene, Registry::with_built_ins(), kinsol(),
                  {.method = "type1/gl:2", .step = 2.0 / 67});
  Sample end;
  (void)run_steps(same, 67);
  (void)same.sample(Momentum::projected, end);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(arrays.last_q(i), end.q[i]);
  EXPECT_EQ(arrays.energy[7], end.energy);
  EXPECT_EQ(arrays.lambda[7], end.lambda[0]);
}

TEST_F(CInterface, ARunWithoutRoomFailsAndKeepsWhatItHas) {
  ASSERT_EQ(open("knife_edge"), DIRACSTEP_OK);
  ASSERT_EQ(create(), DIRACSTEP_OK);
  Arrays arrays(3, 1, 3);
  arrays.points.enlarge = nullptr;
  EXPECT_EQ(diracstep_run(made_, nullptr, &arrays.points), DIRACSTEP_FAILED);
  expect_message({"room for 3 points"});
  EXPECT_EQ(arrays.points.count, 3);
}

TEST_F(CInterface, RunsStopAtTheFlagAndShowTimesInBetween) {
  ASSERT_EQ(open("knife_edge"), DIRACSTEP_OK);
  ASSERT_EQ(create(), DIRACSTEP_OK);
  Arrays arrays(3, 1);
  int stop = 0;
  diracstep_course course{};
  course.stop = &stop;
  course.steps = 1'000'000'000;
  course.every = 1'000'000'000;
  std::thread other([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    std::atomic_ref<int>(stop).store(1);
  });
  EXPECT_EQ(diracstep_run(made_, &course, &arrays.points), DIRACSTEP_INTERRUPTED);
  other.join();
  expect_message({"interrupted at t = "});
  ASSERT_EQ(arrays.points.count, 2);  // the start and where it was stopped
  EXPECT_EQ(arrays.t[1], diracstep_time(made_));

  ASSERT_EQ(create(), DIRACSTEP_OK);
  const double times[] = {0.1, 0.33, 1.0};
  course = {};
  course.times = 3;
  course.time = times;
  ASSERT_EQ(diracstep_run(made_, &course, &arrays.points), DIRACSTEP_OK) << diracstep_message();
  EXPECT_EQ(arrays.points.count, 3);
  EXPECT_EQ(arrays.t[1], 0.33);
}

TEST_F(CInterface, StepsVaryAsTheLibrarysDo) {
  ASSERT_EQ(open("kepler_e06"), DIRACSTEP_OK);
  diracstep_options options{};
  options.method = "type1/gl:3";
  options.eps = 0.2;
  options.ends = 1;
  options.end = 7.0;
  ASSERT_EQ(create(options), DIRACSTEP_OK) << diracstep_message();
  Arrays arrays(2, 0);
  ASSERT_EQ(diracstep_run(made_, nullptr, &arrays.points), DIRACSTEP_OK) << diracstep_message();
  diracstep_statistics statistics{};
  ASSERT_EQ(diracstep_read_statistics(made_, &statistics), DIRACSTEP_OK);
  EXPECT_LT(statistics.smallest, 0.5 * statistics.largest);
  const CatalogueScene entry = make_scene("kepler_e06");
  AdaptiveIntegrator same(entry.scene, Registry::with_built_ins(), kinsol(),
                          {.method = "type1/gl:3", .step = entry.natural_step}, {.eps = 0.2, .end = 7.0});
  Sample end;
  (void)run_until(same, 7.0, Momentum::projected, 1, [&](const Sample& point) {
    end = point;
    return true;
  });
  EXPECT_EQ(arrays.last_q(0), end.q[0]);
  EXPECT_EQ(arrays.last_q(1), end.q[1]);
  std::size_t size = 0;
  EXPECT_EQ(diracstep_save(made_, nullptr, 0, &size), DIRACSTEP_MISUSE);
  expect_message({"fixed size"});
}

/// A current behind 1 mH and 1 kΩ: L/R is a microsecond, the motion takes 13 ms.
TEST_F(CInterface, StepsThatVaryByWhatIsUsualAreDampedWhereTheMotionIs) {
  diracstep_source source{};
  source.text =
      "name = \"load\"\nlagrangian = \"1e-3*v_q^2/2\"\n[coordinates]\nq = {}\n"
      "[force]\nq = \"5 + sin(100*pi*t) - 1000*v_q\"\n[span]\nend = 0.013\nstep = 5e-4\n";
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  diracstep_options options{};
  options.eps = std::nan("");
  options.ends = 1;
  options.end = 0.013;
  ASSERT_EQ(create(options), DIRACSTEP_OK) << diracstep_message();
  Arrays arrays(1, 0);
  ASSERT_EQ(diracstep_run(made_, nullptr, &arrays.points), DIRACSTEP_OK) << diracstep_message();
  diracstep_statistics statistics{};
  ASSERT_EQ(diracstep_read_statistics(made_, &statistics), DIRACSTEP_OK);
  EXPECT_STREQ(statistics.method, "damped/radau:3");
  EXPECT_LT(statistics.smallest, 1e-2 * statistics.largest);
  ASSERT_EQ(open("kepler_e06"), DIRACSTEP_OK);
  ASSERT_EQ(create(options), DIRACSTEP_OK) << diracstep_message();
  ASSERT_EQ(diracstep_read_statistics(made_, &statistics), DIRACSTEP_OK);
  EXPECT_EQ(std::string(statistics.method).find("damped"), std::string::npos) << statistics.method;
}

TEST_F(CInterface, SearchesForAnErrorAndTellsWhatItFound) {
  diracstep_source source{};
  source.text = spring;
  ASSERT_EQ(open(source), DIRACSTEP_OK) << diracstep_message();
  Arrays arrays(1, 0);
  diracstep_error error{};
  error.error = 1e-8;
  diracstep_found found{};
  ASSERT_EQ(diracstep_solve(model_, nullptr, nullptr, &error, &arrays.points, &found), DIRACSTEP_OK)
      << diracstep_message();
  EXPECT_NEAR(arrays.last_q(0), std::cos(6.0), 1e-8);
  EXPECT_LT(found.estimate, 1e-8);
  EXPECT_NE(std::string(found.method).find("type1/"), std::string::npos);
  EXPECT_GE(found.runs.rows, 2);
  ASSERT_EQ(create(), DIRACSTEP_OK);
  for (int k = 0; k < 7; ++k) EXPECT_STREQ(diracstep_doubt(made_), "");  // texts of earlier calls are gone
  ASSERT_EQ(diracstep_solve(model_, nullptr, nullptr, &error, &arrays.points, &found), DIRACSTEP_OK);
  EXPECT_EQ(std::string(found.method).rfind("type1/", 0), 0u);
  EXPECT_NE(std::string(found.reason).find("order"), std::string::npos);
  error.max_solves = 1;
  EXPECT_EQ(diracstep_solve(model_, nullptr, nullptr, &error, &arrays.points, &found), DIRACSTEP_FAILED);
  error.steps = 7;
  EXPECT_EQ(diracstep_solve(model_, nullptr, nullptr, &error, &arrays.points, &found), DIRACSTEP_MISUSE);
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

TEST_F(CInterface, AnEnsembleHasTheEndsOfItsMembersForAnyNumberOfThreads) {
  diracstep_source source{};
  source.text = spring;
  ASSERT_EQ(open(source), DIRACSTEP_OK);
  std::vector<double> starts(50);
  for (std::size_t k = 0; k < starts.size(); ++k) starts[k] = 0.1 * static_cast<double>(k);
  diracstep_options options{};
  options.ends = 1;
  options.end = 2.0;
  diracstep_ensemble ensemble{};
  ensemble.members = 50;
  ensemble.q = starts.data();
  std::vector<std::vector<double>> ends;
  for (const int threads : {1, 3}) {
    ensemble.threads = threads;
    Arrays arrays(1, 0, 50);
    diracstep_table failures{};
    ASSERT_EQ(diracstep_run_ensemble(model_, &options, &ensemble, &arrays.points, &failures), DIRACSTEP_OK)
        << diracstep_message();
    EXPECT_EQ(failures.rows, 0);
    ends.push_back(arrays.q);
  }
  EXPECT_EQ(ends[0], ends[1]);
  for (std::size_t k = 0; k < starts.size(); ++k) EXPECT_NEAR(ends[0][k], starts[k] * std::cos(2.0), 1e-5);
  Arrays few(1, 0, 49);
  EXPECT_EQ(diracstep_run_ensemble(model_, &options, &ensemble, &few.points, nullptr), DIRACSTEP_MISUSE);
  const int stop = 1;
  ensemble.stop = &stop;
  Arrays arrays(1, 0, 50);
  EXPECT_EQ(diracstep_run_ensemble(model_, &options, &ensemble, &arrays.points, nullptr),
            DIRACSTEP_INTERRUPTED);
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

/// A ball that bounces: q = (y, n), n counts, and its height and count are outputs.
const char* const ball =
    "name = \"ball\"\nlagrangian = \"v_y^2/2 - 9.81*y\"\n[coordinates]\ny = {}\n[states]\nn = {}\n"
    "[start]\ny = 1\n[span]\nend = 1.5\nstep = 0.01\n[outputs]\ncount = \"n\"\ntwice = \"2*y\"\n"
    "[[events]]\nname = \"floor\"\nwhen = \"y\"\nrestitution = 0.5\nset = { n = \"n + 1\" }\n"
    "[[events]]\nname = \"top\"\nwhen = \"v_y\"\ndirection = \"falling\"\nif = \"n > 0.5\"\naction = "
    "\"stop\"\n";

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
  diracstep_error error{};
  error.error = 1e-6;
  diracstep_found found{};
  EXPECT_EQ(diracstep_solve(model_, nullptr, nullptr, &error, &arrays.points, &found), DIRACSTEP_MISUSE);
  expect_message({"events"});
  ASSERT_EQ(create(), DIRACSTEP_OK);
  diracstep_derivatives derivatives{};
  derivatives.steps = 3;
  EXPECT_EQ(diracstep_differentiate(model_, made_, &derivatives), DIRACSTEP_MISUSE);
  expect_message({"events"});
  const double times[] = {0.1, 0.2};
  diracstep_course course{};
  course.times = 2;
  course.time = times;
  EXPECT_EQ(diracstep_run(made_, &course, &arrays.points), DIRACSTEP_MISUSE);
  expect_message({"times"});
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
