#include <gtest/gtest.h>

#include <diracstep/core/runs/run.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

namespace diracstep {
namespace {

/// Newton iterations a solve on the first part of a scene, with residuals of 1e-13.
struct Case {
  const char* scene;
  Parameters parameters;
  int order;
  double step;
  /// Of guesses from the acceleration at the start and extrapolated defects of the same substep, which take
  /// one factorisation a substep more; of our own at the two coarsest steps of the pendulum, where those take
  /// 1.98 and 2.09.
  double iterations;
};

class Iterations : public ::testing::TestWithParam<Case> {};

TEST_P(Iterations, OfComposedMidpointStepsAreThoseOfAGoodPredictor) {
  const Case& c = GetParam();
  const CatalogueScene entry = make_scene(c.scene, c.parameters);
  Integrator integrator(entry.scene, Registry::with_built_ins(),
                        kinsol({.tolerance = 1e-13, .accept = 1e-12, .jacobian = JacobianPolicy::fresh}),
                        {.method = "type1/midpoint", .order = c.order, .step = c.step});
  ASSERT_TRUE(run_steps(integrator, 400, Momentum::plus, 400, nullptr).ok());
  const double mean =
      static_cast<double>(integrator.work().iterations) / static_cast<double>(integrator.work().solves);
  RecordProperty("iterations", std::to_string(mean));
  EXPECT_LE(mean, c.iterations + 0.3);
}

INSTANTIATE_TEST_SUITE_P(Predictor, Iterations,
                         ::testing::Values(Case{"pendulum_cartesian", {}, 2, 0.005, 1.00},
                                           Case{"pendulum_cartesian", {}, 4, 0.025, 1.98},
                                           Case{"pendulum_cartesian", {}, 6, 0.05, 2.45},
                                           Case{"pendulum_cartesian", {}, 8, 0.075, 2.99},
                                           Case{"contact_oscillator", {}, 2, 0.01, 1.00},
                                           Case{"contact_oscillator", {}, 4, 0.05, 1.00},
                                           Case{"contact_oscillator", {}, 6, 0.1, 1.53},
                                           Case{"contact_oscillator", {}, 8, 0.15, 1.75},
                                           Case{"chaplygin_sleigh", {}, 6, 0.1, 1.20},
                                           Case{"chaplygin_sleigh", {}, 8, 0.15, 1.20},
                                           Case{"hanging_chain", {{"N", 16.0}}, 4, 0.0025, 1.00},
                                           Case{"hanging_chain", {{"N", 16.0}}, 8, 0.0075, 1.84}));

/// Many links make the tension large beside every momentum: round-off of the impulses is then not small
/// beside p.
TEST(LargeScenes, HangingChainOfManyLinksTakesFewIterations) {
  const CatalogueScene entry = make_scene("hanging_chain", {{"N", 1200.0}});
  struct Run {
    const char* method;
    double step, iterations;
  };
  for (const Run& c : {Run{"type1/midpoint", 2.5e-4, 3.0}, Run{"type1/gl:3", 8e-4, 8.0}}) {
    Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(),
                          {.method = c.method, .step = c.step});
    Work before;
    for (const int steps : {20, 20}) {  // the first ones have nothing to predict from
      before = integrator.work();
      const RunReport report = run_steps(integrator, steps, Momentum::plus, steps, nullptr);
      ASSERT_TRUE(report.ok()) << c.method << ": " << report.last.failure;
    }
    const Work& after = integrator.work();
    const double mean = static_cast<double>(after.iterations - before.iterations) /
                        static_cast<double>(after.solves - before.solves);
    EXPECT_LE(mean, c.iterations) << c.method;
  }
}

/// The first steps of a chain do not get below the tolerance: their scales do not know the tensions yet.  A
/// small correction with a Jacobian of its own point ends them, as one in each iteration does; else they went
/// on until all iterations were used up, were doubted and followed from small steps: 89 iterations in the
/// second one.
TEST(IterationsOfFirstSteps, OfAChainAreFew) {
  constexpr int most = 12;
  const CatalogueScene entry = make_scene("hanging_chain");
  for (const char* method : {"type1/gl:2", "type1/gl:3"}) {
    Integrator integrator(entry.scene, Registry::with_built_ins(), kinsol(),
                          {.method = method, .step = entry.natural_step});
    for (int k = 0; k < 6; ++k) {
      const StepReport report = integrator.step();
      ASSERT_TRUE(report.ok()) << report.failure;
      EXPECT_LE(report.solve.iterations, most) << method << ", step " << k;
    }
    EXPECT_EQ(integrator.work().retries.continuations, 0) << method;
  }
}

}  // namespace
}  // namespace diracstep
