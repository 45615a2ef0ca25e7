#include <cmath>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/plugins/callback_scene.hpp>
#include <diracstep/plugins/differences.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <law_scenes.hpp>

#include "callbacks.hpp"
#include "misuse.hpp"

namespace diracstep::testing {
namespace {

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

}  // namespace
}  // namespace diracstep::testing
