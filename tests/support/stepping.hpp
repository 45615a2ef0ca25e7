#pragma once

#include <gtest/gtest.h>

#include <diracstep/core/runs/run.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <string>
#include <vector>

#include "single_step.hpp"

namespace diracstep::testing {

inline double distance(const Vector& a, const Vector& b) { return (a - b).lpNorm<Eigen::Infinity>(); }

/// Every `every`-th point of a run; fails the test where the run fails.
inline std::vector<Sample> samples_of(const std::shared_ptr<const Scene>& scene,
                                      const IntegratorOptions& options, long steps,
                                      Momentum momentum = Momentum::projected,
                                      const Registry& registry = Registry::with_built_ins(), long every = 1) {
  Integrator integrator(scene, registry, kinsol(), options);
  std::vector<Sample> samples;
  const RunReport report = run_steps(integrator, steps, momentum, every, [&](const Sample& sample) {
    samples.push_back(sample);
    return true;
  });
  EXPECT_TRUE(report.ok()) << report.last.failure;
  return samples;
}

/// The end of a run of fixed steps of about `step`; fails the test where the run fails.
inline Sample end_of(const std::shared_ptr<const Scene>& scene, double end, double step,
                     const std::string& method = "type1/gl:3") {
  const StepGrid grid = fit_steps(scene->start.time, end, step);
  return samples_of(scene, {.method = method, .step = grid.step}, grid.steps, Momentum::projected,
                    Registry::with_built_ins(), grid.steps)
      .back();
}

using laws::join;
using laws::SingleStep;

}  // namespace diracstep::testing
