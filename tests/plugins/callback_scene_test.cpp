#include <diracstep/c_interface/diracstep.h>
#include <diracstep/version.h>

#include <cmath>
#include <diracstep/core/run.hpp>
#include <diracstep/plugins/callback_scene.hpp>
#include <diracstep/plugins/differences.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <law_scenes.hpp>

#include "misuse.hpp"

namespace diracstep::testing {
namespace {

/// The mixed law scene under a force, as callbacks of the C++ scene: values only.
class AsCallbacks {
 public:
  explicit AsCallbacks(std::shared_ptr<const Scene> scene) : scene_(std::move(scene)) {
    l_.data = scene_->lagrangian.get();
    l_.value = [](const void* data, double t, const double* x, const double* y, double* f) {
      const auto& function = *static_cast<const PhaseFunction*>(data);
      *f = function.value(t, in(x), in(y));
      return 0;
    };
    for (std::size_t b = 0; b < scene_->constraints.size(); ++b) {
      const ConstraintRows& rows = *scene_->constraints[b];
      blocks_[b].data = &rows;
      blocks_[b].rows = rows.rows();
      blocks_[b].holonomic = rows.holonomic() ? 1 : 0;
      blocks_[b].position = [](const void* data, double t, const double* q, double* phi) {
        static_cast<const ConstraintRows*>(data)->position(t, in(q), Eigen::Map<Vector>(phi, 1));
        return 0;
      };
      blocks_[b].coefficients = [](const void* data, double t, const double* q, double* a, double* b_) {
        static_cast<const ConstraintRows*>(data)->coefficients(t, in(q), Eigen::Map<Vector>(a, 3),
                                                               Eigen::Map<Vector>(b_, 1));
        return 0;
      };
      if (rows.holonomic()) blocks_[b].coefficients = nullptr;
      list_[b] = &blocks_[b];
    }
    f_.data = scene_->force.get();
    f_.value = [](const void* data, double t, const double* q, const double* v, double* f) {
      static_cast<const Force*>(data)->value(t, in(q), in(v), Eigen::Map<Vector>(f, 3));
      return 0;
    };
    c_.name = "callbacks";
    c_.dimension = 3;
    c_.lagrangian = &l_;
    c_.row_blocks = static_cast<int>(scene_->constraints.size());
    c_.rows = list_.data();
    c_.force = scene_->force ? &f_ : nullptr;
    c_.start_time = scene_->start.time;
    c_.start_q = scene_->start.q.data();
    c_.start_v = scene_->start.v.data();
    c_.step = 0.05;
    c_.end_time = 1.0;
  }
  AsCallbacks(const AsCallbacks&) = delete;
  AsCallbacks& operator=(const AsCallbacks&) = delete;

  diracstep_scene& scene() { return c_; }
  diracstep_function& lagrangian() { return l_; }
  diracstep_rows& rows(std::size_t block) { return blocks_[block]; }

 private:
  static Eigen::Map<const Vector> in(const double* x) { return {x, 3}; }

  std::shared_ptr<const Scene> scene_;
  diracstep_function l_{};
  std::array<diracstep_rows, 2> blocks_{};
  std::array<const diracstep_rows*, 2> list_{};
  diracstep_force f_{};
  diracstep_scene c_{};
};

Sample end_of(const std::shared_ptr<const Scene>& scene, const char* method) {
  Integrator integrator(scene, Registry::with_built_ins(), kinsol(), {.method = method, .step = 0.05});
  const RunReport report = run(integrator, 20, Momentum::projected, 20, nullptr);
  EXPECT_TRUE(report.ok()) << report.last.failure;
  Sample end;
  EXPECT_TRUE(integrator.sample(Momentum::projected, end).ok());
  return end;
}

/// Derivatives by differences are good to about 1e-11, so are forces of rows to 1e-9.
TEST(CallbackScene, MovesLikeTheSceneItWasMadeOf) {
  for (const auto& scene : {laws::mixed(), laws::driven(), laws::forced(laws::mixed())}) {
    AsCallbacks callbacks(scene);
    const auto made = std::make_shared<const Scene>(scene_from(callbacks.scene(), "test"));
    for (const char* method : {"type1/midpoint", "type1/gl:2", "type3/euler"}) {
      const Sample theirs = end_of(made, method), ours = end_of(scene, method);
      EXPECT_LT((theirs.q - ours.q).lpNorm<Eigen::Infinity>(), 1e-9) << scene->name << method;
      EXPECT_LT((theirs.p - ours.p).lpNorm<Eigen::Infinity>(), 1e-9) << scene->name << method;
      EXPECT_LT((theirs.lambda - ours.lambda).lpNorm<Eigen::Infinity>(), 1e-7) << scene->name << method;
    }
  }
}

TEST(CallbackScene, MistakesAreNamed) {
  const auto refused = [](auto change, std::initializer_list<std::string> parts) {
    AsCallbacks callbacks(laws::mixed());
    change(callbacks);
    expect_misuse([&] { scene_from(callbacks.scene(), "scene 's'"); }, parts);
  };
  refused([](AsCallbacks& c) { c.scene().dimension = 0; }, {"scene 's'", "dimension is 0"});
  refused([](AsCallbacks& c) { c.lagrangian().value = nullptr; }, {"lagrangian.value is NULL"});
  refused([](AsCallbacks& c) { c.scene().start_q = nullptr; }, {"start_q"});
  refused([](AsCallbacks& c) { c.rows(0).position = nullptr; }, {"rows.position"});
  refused([](AsCallbacks& c) { c.rows(1).coefficients = nullptr; }, {"rows.coefficients"});
  refused([](AsCallbacks& c) { c.rows(1).rows = -1; }, {"-1 rows"});
  refused(
      [](AsCallbacks& c) {
        static const int starts[] = {0, 1, 2, 3}, rows[] = {0, 7, 2};
        c.lagrangian().pattern = {starts, rows};
      },
      {"lagrangian", "column 1", "row 7", "0 to 2"});
}

TEST(Differences, ColumnsThatShareNoRowGoTogether) {
  std::vector<std::pair<int, int>> entries;
  constexpr int n = 40;
  for (int i = 0; i < n; ++i)
    for (int j = std::max(0, i - 1); j <= std::min(n - 1, i + 1); ++j) entries.emplace_back(i, j);
  const JacobianByDifferences tridiagonal(SparsityPattern(n, n, entries));
  EXPECT_EQ(tridiagonal.groups(), 3u);
  const auto f = [](ConstVectorRef x, VectorRef out) {
    for (int i = 0; i < n; ++i)
      out[i] = std::sin(x[i]) * (i > 0 ? x[i - 1] : 1.0) + (i + 1 < n ? x[i + 1] : 0.0);
  };
  const Vector x = Vector::LinSpaced(n, 0.1, 2.0);
  Vector values(tridiagonal.pattern().nonzeros());
  tridiagonal.evaluate(f, x, values);
  const Columns full = tridiagonal.pattern().full(values);
  for (int i = 1; i + 1 < n; ++i) {
    EXPECT_NEAR(full(i, i), std::cos(x[i]) * x[i - 1], 1e-11);
    EXPECT_NEAR(full(i, i - 1), std::sin(x[i]), 1e-11);
    EXPECT_NEAR(full(i, i + 1), 1.0, 1e-11);
  }
}

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

}  // namespace
}  // namespace diracstep::testing
