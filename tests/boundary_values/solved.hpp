#pragma once

#include <diracstep/boundary_values/boundary_values.hpp>

#include "combinations.hpp"
#include "stepping.hpp"

namespace diracstep::testing {

inline constexpr long steps = 20;

inline BoundaryReport solved(const ScenePointer& scene, const IntegratorOptions& options,
                             const BoundaryConditions& conditions, const GuessedMotion& guess,
                             long count = steps, const Registry& registry = Registry::with_built_ins()) {
  return solve_boundary_values({scene, registry, kinsol(), options, count, conditions, guess});
}

inline GuessedMotion line_between(const ScenePointer& scene, const IntegratorOptions& options,
                                  const Vector& q0, const Vector& qN, long count = steps) {
  const double t0 = scene->start.time;
  return straight_line(t0, q0, t0 + static_cast<double>(count) * options.step, qN);
}

/// The motion of the integrator from the start that was found.
inline void expect_motion(const ScenePointer& scene, const IntegratorOptions& options,
                          const BoundaryReport& report, double bound) {
  Integrator integrator = integrator_for(scene, options);
  Start start = scene->start;
  start.q = report.q.col(0);
  start.v = report.v.col(0);
  integrator.reset(start);
  for (Eigen::Index k = 1; k < report.times.size(); ++k) ASSERT_TRUE(integrator.step().ok());
  Sample end;
  ASSERT_TRUE(integrator.sample(Momentum::projected, end).ok());
  EXPECT_LT(distance(end.q, report.q.rightCols(1)), bound);
  EXPECT_LT(distance(end.v, report.v.rightCols(1)), bound);
  EXPECT_LT(distance(end.p, report.p.rightCols(1)), bound);
}

}  // namespace diracstep::testing
