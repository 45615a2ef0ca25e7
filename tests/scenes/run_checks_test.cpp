#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <diracstep/core/adaptive/variable_run_checks.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/runs/run_checks.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

/// What tells when a run is not to be believed although every step was solved: it speaks where steps are too
/// large, is silent where they are not, and leaves the bits alone.
namespace diracstep {
namespace {

Integrator integrator_for(const CatalogueScene& entry, const std::string& method, double factor) {
  return {entry.scene,
          Registry::with_built_ins(),
          kinsol(),
          {.method = method, .step = factor * entry.natural_step}};
}

/// The text after so many steps, or after those that could be taken.
std::string doubt_of(Integrator& integrator, long steps) {
  RunChecks doubt(integrator, steps);
  for (long k = 0; k < steps; ++k) {
    doubt.before_step(integrator);
    if (!integrator.step().ok()) break;
    doubt.after_step(integrator);
  }
  return doubt.text();
}

TEST(RunChecks, IsSilentOnEverySceneAtItsNaturalStep) {
  for (const std::string& name : scene_names()) {
    const CatalogueScene entry = make_scene(name);
    if (!entry.needs.empty() || !entry.events.empty()) continue;
    for (const double factor : {0.5, 1.0}) {
      Integrator integrator = integrator_for(entry, automatic_method, factor);
      EXPECT_EQ(doubt_of(integrator, 300), "") << name << ", step * " << factor;
    }
    if (entry.scene->rows() == 0 || name == "hanging_chain")
      continue;  // the chain's natural step is too large
    Integrator midpoint = integrator_for(entry, "type1/midpoint", 1.0);
    EXPECT_EQ(doubt_of(midpoint, 300), "") << name;
  }
}

TEST(RunChecks, IsSilentWhereNothingMovesButRoundOff) {
  const std::vector<std::pair<std::string, Parameters>> at_rest{{"hanging_chain", {{"N", 8}, {"g", 0.0}}},
                                                                {"andrews_squeezer", {{"mom", 0.0}}}};
  for (const auto& [name, parameters] : at_rest) {
    const CatalogueScene entry = make_scene(name, parameters);
    Integrator integrator = integrator_for(entry, automatic_method, 1.0);
    RunChecks doubt(integrator, 300);
    Sample point;
    for (int k = 0; k < 300; ++k) {
      ASSERT_TRUE(integrator.sample(Momentum::projected, point).ok());
      doubt.see(point);
      doubt.before_step(integrator);
      ASSERT_TRUE(integrator.step().ok());
      doubt.after_step(integrator);
    }
    EXPECT_EQ(doubt.text(), "") << name;
  }
}

TEST(StepSizeCheck, SeesLargeStepsOfDampedScenes) {
  const CatalogueScene governor = make_scene("flyball_governor");
  Integrator trapezoidal = integrator_for(governor, "type1/trapezoidal", 4.0);
  EXPECT_NE(doubt_of(trapezoidal, 100).find("step size check: from t ="), std::string::npos);
  Integrator implicit = integrator_for(governor, "type1/gl:3", 4.0);
  EXPECT_EQ(doubt_of(implicit, 100), "");
}

TEST(StepSizeCheck, SeesLargeStepsOfDrivenScenes) {
  // q'' = -q + cos(20 t): steps of 5/20 resolve the oscillator, and miss the force
  Scene scene;
  scene.name = "driven";
  scene.coordinates = {"q"};
  scene.lagrangian = lagrangian<1>([](const auto& q, const auto& v, const auto& t) {
    using std::cos;
    return 0.5 * (v[0] * v[0] - q[0] * q[0]) + 20.0 * q[0] * cos(20.0 * t);
  });
  scene.start = {0.0, Vector{{1.0}}, Vector{{0.0}}};
  const auto shared = std::make_shared<const Scene>(scene);
  const auto text = [&](double step) {
    Integrator integrator(shared, Registry::with_built_ins(), kinsol(),
                          {.method = "type1/midpoint", .step = step});
    return doubt_of(integrator, 40);
  };
  EXPECT_NE(text(0.25).find("step size check"), std::string::npos);
  EXPECT_EQ(text(0.01), "");
}

/// x'' = −c v + g in one dimension: with steps far above 1/c the velocity alternates about g/c.
std::shared_ptr<const Scene> damped(double c) {
  Scene scene;
  scene.name = "damped";
  scene.coordinates = {"x"};
  scene.lagrangian = lagrangian<1>([](const auto&, const auto& v) { return 0.5 * v[0] * v[0]; });
  scene.force = force<1>([c](const auto&, const auto& v) { return std::array{1.0 - c * v[0]}; });
  scene.start = {0.0, Vector{{0.0}}, Vector{{1.0}}};
  return std::make_shared<const Scene>(scene);
}

TEST(NodeCheck, SeesVelocitiesThatAlternate) {
  const auto text = [](double step, long steps) {
    Integrator integrator(damped(1e5), Registry::with_built_ins(), kinsol(),
                          {.method = "type1/midpoint", .step = step});
    return doubt_of(integrator, steps);
  };
  EXPECT_NE(text(0.1, 100).find("velocity of x alternates"), std::string::npos) << text(0.1, 100);
  EXPECT_EQ(text(1e-6, 300), "");
}

TEST(NodeCheck, SeesAMomentumThatStaysWhileAForceActs) {
  Scene scene;
  scene.name = "oscillator";
  scene.coordinates = {"x"};
  scene.lagrangian = lagrangian<1>(
      [](const auto& q, const auto& v) { return 1e-27 * (0.5 * v[0] * v[0] - 0.5e12 * q[0] * q[0]); });
  scene.start = {0.0, Vector{{1e-6}}, Vector{{0.0}}};
  const auto text = [&](double change) {
    NodeCheck check(scene, 100);
    for (long k = 0; k < 20; ++k) {
      const double t = 1e-7 * static_cast<double>(k);
      Sample node{.time = t,
                  .q = Vector{{1e-6}},
                  .v = Vector{{0.0}},
                  .p = Vector{{0.0}},
                  .lambda = {},
                  .impulse = {}};
      if (change > 0.0) {
        node.q[0] *= std::cos(1e6 * t);
        node.p[0] = -1e-27 * std::sin(1e6 * t);
        node.v[0] = -std::sin(1e6 * t);
      }
      if (check.wants(k)) check.see(k, node);
    }
    return check.text();
  };
  EXPECT_NE(text(0.0).find("does not respond to the force"), std::string::npos);
  EXPECT_EQ(text(1.0), "");
}

TEST(VariableRunChecks, LookAtVelocitiesOfVariableSteps) {
  const auto scene = damped(1e5);
  const auto text = [&](double rate) {
    const Monitor monitor{.rate = [rate](double, ConstVectorRef, ConstVectorRef) { return rate; },
                          .depends_on_velocity = false};
    const IntegratorOptions options{.method = "type1/midpoint", .step = 0.1};
    AdaptiveIntegrator integrator(scene, Registry::with_built_ins(), kinsol(), options,
                                  {.eps = 0.1, .monitor = monitor, .end = 4.0});
    VariableRunChecks checks(integrator, {scene, Registry::with_built_ins(), kinsol(), options});
    for (long k = 0; k < 40; ++k) {
      checks.before_step();
      EXPECT_TRUE(integrator.step().ok());
      checks.after_step();
    }
    return checks.text();
  };
  EXPECT_NE(text(1.0), "");
  EXPECT_EQ(text(1e5), "");
}

TEST(EnergyCheck, ReadsWhatIsKeptFromTheFormulas) {
  Scene scene;
  scene.name = "driven";
  scene.coordinates = {"x"};
  scene.start = {0.0, Vector{{0.0}}, Vector{{0.0}}};
  // L(t) = L(t + 1) at the start, and at every start with x = 0.
  scene.lagrangian = lagrangian<1>([](const auto& q, const auto& v, const auto& t) {
    using std::sin;
    return 0.5 * v[0] * v[0] - 0.5 * q[0] * q[0] + q[0] * sin(2.0 * t);
  });
  EXPECT_FALSE(keeps_energy(scene));
  scene.lagrangian =
      lagrangian<1>([](const auto& q, const auto& v) { return 0.5 * v[0] * v[0] - 0.5 * q[0] * q[0]; });
  EXPECT_TRUE(keeps_energy(scene));
}

/// The implicit Euler method takes the energy out of an oscillator, which is told as what it is.
TEST(EnergyCheck, TellsWhatAMethodDampsAway) {
  Scene scene;
  scene.name = "oscillator";
  scene.coordinates = {"x"};
  scene.start = {0.0, Vector{{1.0}}, Vector{{0.0}}};
  scene.lagrangian =
      lagrangian<1>([](const auto& q, const auto& v) { return 0.5 * v[0] * v[0] - 0.5 * q[0] * q[0]; });
  const auto shared = std::make_shared<const Scene>(scene);
  for (const auto& [method, cause] :
       {std::pair("damped/radau:1", "the method damps"), std::pair("type1/right", "the step is too large")}) {
    Integrator integrator(shared, Registry::with_built_ins(), kinsol(),
                          {.method = method, .step = method[0] == 'd' ? 0.1 : 2.5});
    RunChecks checks(integrator, 100);
    ASSERT_TRUE(run_steps(integrator, 100, Momentum::projected, 1, nullptr, &checks).ok());
    EXPECT_NE(checks.text().find(cause), std::string::npos) << checks.text();
  }
}

TEST(EnergyCheck, DoesNotDependOnTheOrigin) {
  for (const double origin : {0.0, 1e6}) {
    Scene scene;
    scene.name = "shifted";
    scene.coordinates = {"x"};
    scene.lagrangian = lagrangian<1>([origin](const auto& q, const auto& v) {
      const auto x = q[0] - origin;
      return 0.5 * v[0] * v[0] - 0.5 * x * x + 1e3 * origin;
    });
    scene.start = {0.0, Vector{{origin + 1.0}}, Vector{{0.0}}};
    EnergyCheck check(scene);
    const auto see = [&](double t, double x, double v) {
      Sample point{.time = t,
                   .q = Vector{{origin + x}},
                   .v = Vector{{v}},
                   .p = Vector{{v}},
                   .lambda = {},
                   .impulse = {}};
      point.energy = scene.energy(t, point.q, point.v);
      check.see(point);
    };
    see(0.0, 1.0, 0.0);
    see(1.0, 0.5, -0.86);
    EXPECT_EQ(check.text(), "") << origin;
    see(2.0, 0.0, -1.2);
    EXPECT_NE(check.text(), "") << origin;
  }
}

TEST(StepSizeCheck, LeavesTheBitsAlone) {
  for (const char* name :
       {"knife_edge", "pendulum_cartesian", "kepler_e06", "lotka_volterra_2d", "hanging_chain"}) {
    const CatalogueScene entry = make_scene(name);
    Integrator watched = integrator_for(entry, "type1/gl:2", 0.2),
               alone = integrator_for(entry, "type1/gl:2", 0.2);
    (void)doubt_of(watched, 40);
    for (int k = 0; k < 40; ++k) ASSERT_TRUE(alone.step().ok()) << name;
    EXPECT_EQ(watched.save().numbers(), alone.save().numbers()) << name;
  }
}

/// A four-bar mechanism of one window whose coupler is turned over by force at a flat pose: the velocity of
/// its second upright is reversed, which every row allows there.
TEST(BranchCheck, SeesAMotionThatLeavesItsBranch) {
  const CatalogueScene entry = make_scene("n_four_bar", {{"N", 1}});
  Integrator integrator = integrator_for(entry, "type1/gl:2", 0.5);
  BranchCheck doubt(integrator);
  double lowest = HUGE_VAL;
  for (int k = 0; k < 400; ++k) {
    ASSERT_TRUE(integrator.step().ok());
    doubt.after(integrator);
    lowest = std::min(lowest, std::abs(integrator.position()[1]));
  }
  EXPECT_LT(lowest, 0.05) << "no flat pose was passed";
  EXPECT_EQ(doubt.text(), "") << "the branch was kept";

  const double start = integrator.time();
  while (integrator.position()[1] *
             (integrator.position()[1] + 0.5 * entry.natural_step * integrator.velocity_estimate()[1]) >
         0.0)
    ASSERT_TRUE(integrator.step().ok()), doubt.after(integrator);
  ASSERT_LT(integrator.time(), start + 10.0);
  Vector v = integrator.velocity_estimate(), p = integrator.momentum();
  v.tail(2) *= -1.0;
  p.tail(2) *= -1.0;
  integrator.restart(integrator.time(), integrator.position(), p, v);
  for (int k = 0; k < 2 && integrator.step().ok(); ++k) doubt.after(integrator);
  EXPECT_NE(doubt.text().find("may have left its branch"), std::string::npos);
}

/// Of ten windows, type2/euler at h = 0.01 used to fold one at the flat pose of t = 15.
TEST(Branches, AreKeptThroughFlatPoses) {
  const CatalogueScene entry = make_scene("n_four_bar", {{"N", 10}});
  for (const char* method : {"type2/euler", "type3/euler"}) {
    Integrator integrator = integrator_for(entry, method, 1.0);
    EXPECT_EQ(doubt_of(integrator, 2000), "") << method;
    EXPECT_GE(integrator.work().retries.other_branches, 1) << method << ": nothing to keep";
    const Vector& q = integrator.position();
    for (Eigen::Index j = 1; 2 * j < q.size(); ++j) {
      EXPECT_NEAR(q[2 * j] - static_cast<double>(j), q[0], 1e-9) << method;
      EXPECT_NEAR(q[2 * j + 1], q[1], 1e-9) << method;
    }
  }
}

/// The rows of a four-bar mechanism nearly depend on each other there, but not at poses around.
TEST(Branches, AStartCloseToAFlatPoseIsNotRefused) {
  const CatalogueScene entry = make_scene("n_four_bar", {{"N", 1}});
  Scene scene = *entry.scene;
  const double height = 1e-8, width = std::sqrt(1.0 - height * height);
  scene.start.q << width, height, 1.0 + width, height;
  scene.start.v << 0.0, -1.0, 0.0, -1.0;
  scene.start.v[0] = scene.start.v[2] = height / width;
  Integrator integrator(std::make_shared<const Scene>(scene), Registry::with_built_ins(), kinsol(),
                        {.step = 0.01});
  EXPECT_EQ(doubt_of(integrator, 100), "");
  EXPECT_EQ(integrator.work().steps, 100);
}

}  // namespace
}  // namespace diracstep
