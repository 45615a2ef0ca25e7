#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/system/phase_function.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

/// Steps on two positions are solved for the increment q1 − q0: its velocity (q1 − q0)/h does not lose 1/h of
/// the digits of q1.
namespace diracstep {
namespace {

/// Forth and back over t = 1, in many short steps, far from the origin.
double lost(const std::string& method, long steps) {
  Scene scene;
  scene.name = "curved";
  scene.coordinates = {"x", "y"};
  scene.lagrangian = lagrangian<2>([](const auto& q, const auto& v) {
    return 0.5 * (1.0 + 0.1 * q[1] * q[1]) * v[0] * v[0] + 0.5 * v[1] * v[1] - 0.5 * q[0] * q[0] -
           0.5 * q[1] * q[1];
  });
  scene.start = {0.0, Vector{{1.0, 0.5}}, Vector{{0.2, -0.3}}};
  const double h = 1.0 / static_cast<double>(steps);
  Integrator integrator(std::make_shared<const Scene>(scene), Registry::with_built_ins(), kinsol(),
                        {.method = method, .order = 2, .step = h});
  for (const double step : {h, -h})
    for (long k = 0; k < steps; ++k) EXPECT_TRUE(integrator.step(step).ok());
  return (integrator.position() - scene.start.q).lpNorm<Eigen::Infinity>();
}

TEST(Increment, ManyShortStepsLoseNoMoreThanThoseOfStages) {
  for (const char* method : {"type1/left", "type1/right", "type1/trapezoidal"})
    EXPECT_LT(lost(method, 3200), 2e-13) << method;
}

}  // namespace
}  // namespace diracstep
