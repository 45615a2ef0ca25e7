#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "differences.hpp"
#include "methods.hpp"
#include "stepping.hpp"

/// Checks of Gauss-Lobatto steps of degenerate scenes.
namespace diracstep::testing {

/// A scene and where its motion is at t = 1 by the reference: positions, and forces of the rows.
struct DegenerateCase {
  std::shared_ptr<const Scene> scene;
  Vector q, lambda = {};
};

/// The largest error of positions and forces of rows at t = 1.
inline double error_at_end(const DegenerateCase& that, const std::string& method, long steps) {
  const Sample end = samples_of(that.scene, {.method = method, .step = 1.0 / static_cast<double>(steps)},
                                steps, Momentum::projected, Registry::with_built_ins(), steps)
                         .back();
  const double error = distance(end.q, that.q);
  return that.lambda.size() == 0 ? error : std::max(error, distance(end.lambda, that.lambda));
}

/// 2s, from the errors of `steps` and twice as many, where these are above `round_off`.
inline void expect_order_of_stages(const DegenerateCase& that, int s, long steps, double round_off) {
  const double first = error_at_end(that, gl(s), steps), second = error_at_end(that, gl(s), 2 * steps);
  EXPECT_GT(second, round_off) << that.scene->name << ": at round-off, nothing is measured";
  EXPECT_NEAR(std::log2(first / second), 2.0 * s, 0.4)
      << that.scene->name << " s = " << s << " errors " << first << " " << second;
}

/// The Jacobian of a step from the start, beside its guess.
inline void expect_exact_jacobian(const DegenerateCase& that, int s) {
  const auto scene = completed(that.scene);
  const Eigen::Index n = scene->dimension();
  const auto problem = Registry::with_built_ins().method(gl(s)).make_step(*scene, {true});
  Vector p(n), lq(n), x(problem->size());
  scene->lagrangian->gradient(0.0, scene->start.q, scene->start.v, lq, p);
  problem->begin({0.0, 0.2}, {scene->start.q, p, scene->start.v}, {});
  problem->guess(scene->start.v, x);
  x += 0.1 * Vector::LinSpaced(x.size(), -1.0, 1.3);
  EXPECT_LT(jacobian_error(*problem, x), 1e-7) << scene->name << " s = " << s;
}

inline void expect_on_holonomic_rows(const Scene& scene, const Sample& at) {
  for (const auto& rows : scene.constraints) {
    if (!rows->holonomic()) continue;
    Vector phi(1);
    rows->position(at.time, at.q, phi);
    EXPECT_LT(std::abs(phi[0]), 1e-13) << scene.name;
  }
}

/// A step there and one back lead to where they began.
inline void expect_self_adjoint(const DegenerateCase& that, int s, double round_off) {
  const Sample there = samples_of(that.scene, {.method = gl(s), .step = 0.1}, 1).back();
  auto back = std::make_shared<Scene>(*that.scene);
  back->start = {there.time, there.q, there.v};
  const Sample again = samples_of(back, {.method = gl(s), .step = -0.1}, 1).back();
  EXPECT_LT(distance(again.q, that.scene->start.q), round_off) << that.scene->name << " s = " << s;
}

}  // namespace diracstep::testing
