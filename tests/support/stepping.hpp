#pragma once

#include <gtest/gtest.h>

#include <diracstep/core/runs/run.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <string>
#include <vector>

#include "single_step.hpp"

namespace diracstep::testing {

/// Kept points of a run; fails the test where the run fails.
inline std::vector<Sample> samples_of(const std::shared_ptr<const Scene>& scene,
                                      const IntegratorOptions& options, long steps,
                                      Momentum momentum = Momentum::projected,
                                      const Registry& registry = Registry::with_built_ins()) {
  Integrator integrator(scene, registry, kinsol(), options);
  std::vector<Sample> samples;
  const RunReport report = run_steps(integrator, steps, momentum, 1, [&](const Sample& sample) {
    samples.push_back(sample);
    return true;
  });
  EXPECT_TRUE(report.ok()) << report.last.failure;
  return samples;
}

using laws::join;
using laws::SingleStep;

}  // namespace diracstep::testing
