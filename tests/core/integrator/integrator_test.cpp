#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <limits>
#include <thread>

#include "allocations.hpp"
#include "combinations.hpp"
#include "differences.hpp"
#include "misuse.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::expect_misuse;
using testing::expect_parts;
using testing::for_every_combination;
using testing::integrator_for;
using testing::join;
using testing::same_bits;
using testing::samples_of;
using testing::ScenePointer;

const double nan = std::numeric_limits<double>::quiet_NaN();
const double infinity = std::numeric_limits<double>::infinity();

// --- Construction
// -----------------------------------------------------------------------------------------------

void expect_refused(const ScenePointer& scene, const IntegratorOptions& options,
                    std::initializer_list<std::string> parts) {
  expect_misuse([&] { (void)integrator_for(scene, options); }, parts);
}

TEST(Integrator, MisuseIsFoundAtConstruction) {
  const auto scene = testing::nonholonomic();
  expect_refused(scene, {}, {"step size is 0"});
  expect_refused(scene, {.step = nan}, {"step size is nan"});
  expect_refused(scene, {.step = infinity}, {"step size is inf"});
  expect_refused(scene, {.method = "type1/none", .step = 0.1}, {"'type1/none'", "type1/midpoint"});
  expect_refused(nullptr, {.step = 0.1}, {"no scene"});
  auto off = std::make_shared<Scene>(*scene);
  off->start.v[0] += 1.0;
  expect_refused(off, {.step = 0.1}, {"'contact'"});
}

TEST(Integrator, OrdersThatCannotBeComposedAreRefusedWithThoseThatCan) {
  for (const int order : {-2, 1, 3, 5, 7})
    expect_refused(testing::mixed(), {.method = "type1/midpoint", .order = order, .step = 0.1},
                   {"order " + std::to_string(order) + ";", "2, 4, 6, 8"});
  expect_refused(testing::mixed(), {.method = "type1/left", .order = 3, .step = 0.1},
                 {"order 3;", "2, 4, 6, 8"});
}

TEST(Integrator, MomentumThatIsNotFiniteAtTheStartIsRefused) {
  Scene scene = testing::particle("infinite");
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    using std::sqrt;
    return sqrt(v[0]) + 0.5 * (v[1] * v[1] + v[2] * v[2]) - q[0];
  });
  scene.start.v[0] = 0.0;
  expect_refused(std::make_shared<const Scene>(scene), {.step = 0.1}, {"'infinite'", "not finite"});
}

// --- What is read
// -----------------------------------------------------------------------------------------------

TEST(Momentum, PlusAndMinusAreTheTwoDiscreteLegendreTransforms) {
  const auto scene = testing::mixed();
  const IntegratorOptions options{.method = "type1/midpoint", .step = 0.05};
  const auto plus = samples_of(scene, options, 3, Momentum::plus);
  const auto minus = samples_of(scene, options, 3, Momentum::minus);
  const auto l_d = Registry::with_built_ins().method("type1/midpoint").generating_function(*scene);
  Columns y(3, 2), g(3, 2);
  y << plus[1].q, plus[2].q;
  l_d->gradient({plus[1].time, options.step}, y, g);
  EXPECT_LT(testing::distance(plus[2].p, g.col(1)), 1e-12);
  EXPECT_LT(testing::distance(minus[1].p, -g.col(0)), 1e-12);
  EXPECT_GT(testing::distance(minus[1].p, plus[1].p), 1e-4) << "the impulse vanishes, so nothing is tested";
}

TEST(Momentum, ProjectedIsThatOfAVelocityInTheDistributionAndInTheSameClass) {
  for (const auto& scene : testing::every_constraint_class())
    for (const Momentum other : {Momentum::plus, Momentum::minus}) {
      const IntegratorOptions options{.method = "type1/midpoint", .step = 0.05};
      const Sample projected = samples_of(scene, options, 3).back();
      const Sample raw = samples_of(scene, options, 3, other).back();
      Vector lq(3), p(3);
      scene->lagrangian->gradient(projected.time, projected.q, projected.v, lq, p);
      EXPECT_EQ(projected.p, p) << scene->name;
      if (scene->rows() == 0) {
        EXPECT_LT(testing::distance(raw.p, projected.p), 1e-14);
        continue;
      }
      ConstraintsAtPoint rows(scene->constraints, 3);
      rows.evaluate(projected.time, projected.q);
      Vector velocity(rows.rows());
      rows.velocity_residual(projected.v, velocity);
      EXPECT_LT(velocity.lpNorm<Eigen::Infinity>(), 1e-14) << scene->name;
      const Eigen::MatrixXd a = testing::full(rows.pattern(), rows.coefficients());
      const Vector difference = raw.p - projected.p;
      const Vector lambda = a.transpose().colPivHouseholderQr().solve(difference);
      EXPECT_LT(testing::distance(a.transpose() * lambda, difference), 1e-13) << scene->name;
      EXPECT_GT(difference.norm(), 1e-4) << "the momenta agree, so nothing is tested";
    }
}

TEST(Integrator, ReadingDoesNotChangeTheTrajectoryByABit) {
  for_every_combination([](const ScenePointer& scene, const IntegratorOptions& options) {
    for (const Momentum momentum : {Momentum::plus, Momentum::minus, Momentum::projected}) {
      Integrator read = integrator_for(scene, options), unread = integrator_for(scene, options);
      Sample sample;
      bool same = true;
      for (int k = 0; k < 10; ++k) {
        ASSERT_TRUE(read.sample(momentum, sample).ok());
        ASSERT_TRUE(read.step().ok());
        ASSERT_TRUE(unread.step().ok());
        same = same && read.position() == unread.position();
      }
      EXPECT_TRUE(same);
      EXPECT_EQ(read.work().solves, unread.work().solves);
      EXPECT_EQ(read.work().iterations, unread.work().iterations);
      EXPECT_EQ(read.work().residual_evaluations, unread.work().residual_evaluations);
    }
  });
}

TEST(Integrator, ReadingIsNotNoticedByStepsOfAnotherSizeRetriesAndSnapshots) {
  for_every_combination([](const ScenePointer& scene, const IntegratorOptions& options) {
    Integrator read = integrator_for(scene, options), unread = integrator_for(scene, options);
    const auto same = [&] {
      Sample sample;
      EXPECT_TRUE(read.sample(Momentum::minus, sample).ok());
      EXPECT_TRUE(read.save().bytes() == unread.save().bytes());
    };
    for (const double h : {0.05, 0.03, 0.06, 0.05, 0.05}) {
      for (Integrator* integrator : {&read, &unread}) ASSERT_TRUE(integrator->step(h).ok());
      same();
      for (Integrator* integrator : {&read, &unread}) ASSERT_TRUE(integrator->retry(0.9 * h).ok());
      same();
    }
  });
}

TEST(Integrator, TheMinusMomentumIsThatOfTheStepTakenNext) {
  for_every_combination([](const ScenePointer& scene, const IntegratorOptions& options) {
    if (scene->rows() == 0 || options.order > 0) return;  // a composition solves its first stage alone
    Integrator integrator = integrator_for(scene, options);
    const Method method = Registry::with_built_ins().method(options.method);
    Sample minus;
    for (int k = 0; k < 8; ++k) {
      ASSERT_TRUE(integrator.sample(Momentum::minus, minus).ok());
      const testing::SingleStep::Result step =
          testing::SingleStep(method, *scene)({integrator.time(), options.step}, integrator.position(),
                                              integrator.momentum(), integrator.velocity_estimate());
      EXPECT_LT(testing::distance(minus.impulse, step.impulse), 1e-11);
      ASSERT_TRUE(integrator.step().ok());
      EXPECT_LT(testing::distance(integrator.position(), step.q1), 1e-11);
    }
  });
}

TEST(Integrator, WhatIsReadDoesNotDependOnEarlierReadings) {
  for_every_combination([](const ScenePointer& scene, const IntegratorOptions& options) {
    for (const Momentum momentum : {Momentum::plus, Momentum::minus, Momentum::projected}) {
      Integrator often = integrator_for(scene, options), once = integrator_for(scene, options);
      Sample a, b;
      for (int k = 0; k < 10; ++k) {
        ASSERT_TRUE(often.sample(momentum, a).ok());
        ASSERT_TRUE(often.step().ok());
        ASSERT_TRUE(once.step().ok());
      }
      ASSERT_TRUE(often.sample(momentum, a).ok());
      ASSERT_TRUE(often.sample(momentum, a).ok());
      ASSERT_TRUE(once.sample(momentum, b).ok());
      EXPECT_TRUE(same_bits(a, b));
    }
  });
}

// --- No hidden state
// --------------------------------------------------------------------------------------------

std::vector<Sample> run_of(Integrator& integrator) {
  std::vector<Sample> samples;
  const RunReport report = run_steps(integrator, 20, Momentum::minus, 1, [&](const Sample& sample) {
    samples.push_back(sample);
    return true;
  });
  EXPECT_TRUE(report.ok()) << report.last.failure;
  return samples;
}

TEST(Integrator, ResetRepeatsTheRunBitByBit) {
  for_every_combination([](const ScenePointer& scene, const IntegratorOptions& options) {
    Integrator integrator = integrator_for(scene, options);
    const auto first = run_of(integrator);
    const Work work = integrator.work();
    integrator.reset();
    EXPECT_EQ(integrator.time(), scene->start.time);
    EXPECT_EQ(integrator.position(), scene->start.q);
    EXPECT_EQ(integrator.work().solves, 0);
    EXPECT_TRUE(same_bits(run_of(integrator), first));
    EXPECT_EQ(integrator.work().iterations, work.iterations);
  });
}

TEST(Integrator, ResetToAnotherStartRunsLikeANewIntegratorFromThere) {
  for (const auto& scene : testing::every_constraint_class()) {
    const Sample later = samples_of(scene, {.step = 0.05}, 7).back();
    const Start start{later.time, later.q, later.v};
    auto moved = std::make_shared<Scene>(*scene);
    moved->start = start;
    Integrator used = integrator_for(scene, {.step = 0.05}), fresh = integrator_for(moved, {.step = 0.05});
    (void)run_of(used);
    used.reset(start);
    EXPECT_TRUE(same_bits(run_of(used), run_of(fresh))) << scene->name;
  }
  Integrator integrator = integrator_for(testing::mixed(), {.step = 0.05});
  Start off = testing::mixed()->start;
  off.q[0] += 0.1;
  expect_misuse([&] { integrator.reset(off); }, {"'sphere'"});
}

TEST(Integrator, ResetForgetsTheSizeOfEarlierResiduals) {
  // Round-off of a residual is judged by the size of its terms, which here is 1e12 before the reset.
  Scene scene;
  scene.name = "oscillator";
  scene.coordinates = {"x"};
  scene.lagrangian = lagrangian<1>([](const auto& q, const auto& v) {
    return 0.5 * v[0] * v[0] - 0.5 * q[0] * q[0] + 0.1 * q[0] * q[0] * v[0];
  });
  scene.start = {0.0, Vector::Constant(1, 0.5), Vector::Constant(1, 0.2)};
  const auto shared = std::make_shared<const Scene>(scene);
  for (const char* method : {"type1/midpoint", "type1/trapezoidal", "type3/legendre(type1/midpoint)"}) {
    const IntegratorOptions options{.method = method, .step = 0.01};
    Integrator used = integrator_for(shared, options), fresh = integrator_for(shared, options);
    used.reset({0.0, Vector::Constant(1, 1e12), Vector::Zero(1)});
    (void)used.step();  // whether round-off of this size allows a solution or not
    used.reset();
    EXPECT_TRUE(same_bits(run_of(used), run_of(fresh))) << method;
    EXPECT_EQ(used.work().iterations, fresh.work().iterations) << method;
  }
}

TEST(Integrator, GoesOnAfterAMove) {
  for (const auto& scene : testing::every_constraint_class()) {
    Integrator stays = integrator_for(scene, {.method = "type1/gl:2", .step = 0.05});
    Integrator goes = integrator_for(scene, {.method = "type1/gl:2", .step = 0.05});
    EXPECT_TRUE(goes.step().ok() && stays.step().ok());
    Integrator arrived = std::move(goes);
    EXPECT_TRUE(same_bits(run_of(arrived), run_of(stays)));
  }
}

TEST(Integrator, TwoSideBySideRunAsIfAlone) {
  for_every_combination([](const ScenePointer& scene, const IntegratorOptions& options) {
    IntegratorOptions slower = options;
    slower.step = options.step / 3.0;
    Integrator alone = integrator_for(scene, options), a = integrator_for(scene, options);
    Integrator b = integrator_for(testing::mixed(), slower);
    for (int k = 0; k < 10; ++k) {
      ASSERT_TRUE(alone.step().ok());
      ASSERT_TRUE(a.step().ok());
      ASSERT_TRUE(b.step().ok());
      EXPECT_EQ(alone.position(), a.position());
    }
  });
}

TEST(Integrator, TwoOnThreadsRunAsIfAlone) {
  for_every_combination([](const ScenePointer& scene, const IntegratorOptions& options) {
    Integrator alone = integrator_for(scene, options);
    const auto expected = run_of(alone);
    std::array<std::vector<Sample>, 2> found;
    std::array<std::thread, 2> threads;
    for (std::size_t i = 0; i < 2; ++i)
      threads[i] = std::thread([&, i] {
        Integrator integrator = integrator_for(scene, options);
        found[i] = run_of(integrator);
      });
    for (std::thread& thread : threads) thread.join();
    for (const auto& samples : found) EXPECT_TRUE(same_bits(samples, expected));
  });
}

TEST(Integrator, StepsAllocateNothing) {
  if (!testing::counts_allocations) GTEST_SKIP() << "allocations cannot be counted here";
  for_every_combination([](const ScenePointer& scene, const IntegratorOptions& options) {
    if (options.method == "type2/euler") return;  // evaluates a Hamiltonian derived from L, which allocates
    Integrator integrator = integrator_for(scene, options);
    for (int k = 0; k < 20; ++k) ASSERT_TRUE(integrator.step().ok());
    const long before = testing::allocations;
    bool ok = true;
    for (int k = 0; k < 40; ++k) ok = ok && integrator.step().ok();
    EXPECT_EQ(testing::allocations - before, 0);
    EXPECT_TRUE(ok);
  });
}

TEST(AdaptiveIntegrator, StepsAllocateNothing) {
  if (!testing::counts_allocations) GTEST_SKIP() << "allocations cannot be counted here";
  for (const auto& scene : testing::every_constraint_class())
    for (const StepControl control : {StepControl::integrating, StepControl::in_step}) {
      AdaptiveIntegrator integrator(scene, Registry::with_built_ins(), kinsol(),
                                    {.method = "type1/gl:3", .step = 0.1, .compensated_sums = true},
                                    {.eps = 0.2, .control = control});
      for (int k = 0; k < 30; ++k) ASSERT_TRUE(integrator.step().ok());
      const long before = testing::allocations;
      for (int k = 0; k < 20; ++k) ASSERT_TRUE(integrator.step().ok());
      EXPECT_EQ(testing::allocations - before, 0) << scene->name;
    }
}

TEST(Integrator, FixedPointStepsAndKeptJacobiansAllocateNothing) {
  if (!testing::counts_allocations) GTEST_SKIP() << "allocations cannot be counted here";
  for (const auto& scene : testing::every_constraint_class())
    for (const KinsolOptions& solver : {KinsolOptions{.iteration = Iteration::fixed_point},
                                        KinsolOptions{.jacobian = JacobianPolicy::kept}}) {
      Integrator integrator(scene, Registry::with_built_ins(), kinsol(solver),
                            {.method = "type1/gl:3", .step = 0.05});
      for (int k = 0; k < 20; ++k) ASSERT_TRUE(integrator.step().ok());
      const long before = testing::allocations;
      bool ok = true;
      for (int k = 0; k < 40; ++k) ok = ok && integrator.step().ok();
      EXPECT_EQ(testing::allocations - before, 0) << scene->name;
      EXPECT_TRUE(ok);
    }
}

// --- Plans
// ------------------------------------------------------------------------------------------------------

/// The decision of a plan on one item.
std::string decision(const ScenePointer& scene, const IntegratorOptions& options, const std::string& item) {
  const Integrator integrator = integrator_for(scene, options);
  for (const PlanLine& line : integrator.plan())
    if (line.item == item) return line.decision;
  return "no line";
}

TEST(Plan, LeavesOutWhatTheSceneDoesNotNeed) {
  const IntegratorOptions options{.method = "type1/midpoint", .step = 0.1};
  for (const char* item : {"multipliers", "projection", "composition", "forces"})
    EXPECT_EQ(decision(testing::unconstrained(), options, item), "left out") << item;
  EXPECT_EQ(decision(testing::mixed(), options, "multipliers"), "2");
  EXPECT_NE(decision(testing::mixed(), options, "projection"), "left out");
  EXPECT_NE(decision(testing::forced(testing::mixed()), options, "forces"), "left out");
  EXPECT_EQ(decision(testing::mixed(), {.method = "type1/midpoint", .order = 4, .step = 0.1}, "composition"),
            "5 stages");
}

TEST(Plan, NamesTheUnknownsAndTheSolver) {
  const IntegratorOptions options{.method = "type1/trapezoidal", .step = 0.1};
  EXPECT_EQ(decision(testing::unconstrained(), options, "unknowns"), "q1 - q0 (3)");
  EXPECT_EQ(decision(testing::mixed(), options, "unknowns"), "q1 - q0 (3), multipliers (2)");
  EXPECT_EQ(decision(testing::mixed(), {.method = "type1/midpoint", .step = 0.1}, "unknowns"),
            "stage velocities (3), multipliers (2)");
  EXPECT_EQ(decision(testing::mixed(), options, "Jacobian"), "full");
  expect_parts(decision(testing::mixed(), options, "nonlinear solver"), {"KINSOL", "dense"});
  const IntegratorOptions sparse{.method = "type1/trapezoidal", .step = 0.1, .dense_limit = 0};
  EXPECT_EQ(decision(testing::mixed(), sparse, "Jacobian"), "sparse");
}

TEST(Plan, ExplicitStepsLeaveOutTheSolver) {
  const IntegratorOptions options{.method = "type1/trapezoidal", .step = 0.1};
  EXPECT_EQ(decision(testing::edge_of_the_domain(), options, "nonlinear solver"), "left out");
  EXPECT_EQ(decision(testing::edge_of_the_domain(), options, "unknowns"), "none");
  EXPECT_EQ(decision(testing::edge_of_the_domain(), options, "Jacobian"), "no line");
  EXPECT_NE(decision(testing::unconstrained(), options, "nonlinear solver"), "left out");
}

}  // namespace
}  // namespace diracstep
