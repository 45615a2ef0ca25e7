#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/adaptive_integrator.hpp>
#include <diracstep/core/run.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <limits>
#include <map>
#include <sstream>
#include <thread>

#include "allocations.hpp"
#include "combinations.hpp"
#include "differences.hpp"
#include "misuse.hpp"
#include "stepping.hpp"

namespace diracstep {
namespace {

using testing::describe;
using testing::every_kind_of_step;
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

double distance(const Vector& a, const Vector& b) { return (a - b).lpNorm<Eigen::Infinity>(); }

// --- Step sizes
// -------------------------------------------------------------------------------------------------

void expect_grid(double start, double end, double step, long count, double size) {
  const StepGrid grid = fit_steps(start, end, step);
  EXPECT_EQ(grid.steps, count) << start << " " << end << " " << step;
  EXPECT_EQ(grid.step, size) << start << " " << end << " " << step;
}

TEST(FitSteps, StepsThatDivideTheIntervalAreKept) {
  expect_grid(0.0, 1.0, 0.125, 8, 0.125);
  expect_grid(2.0, 1.0, -0.25, 4, -0.25);
  expect_grid(0.0, 29.7, 0.05, 594, 29.7 / 594.0);
  expect_grid(0.0, 3.0 * 0.1, 0.1, 3, 3.0 * 0.1 / 3.0);
}

TEST(FitSteps, OtherStepsBecomeSmallerUntilTheyFit) {
  expect_grid(0.0, 1.0, 0.3, 4, 0.25);
  expect_grid(0.0, 1.0, 0.9, 2, 0.5);
  expect_grid(1.0, -1.0, -0.75, 3, -2.0 / 3.0);
  expect_grid(0.0, 1.0, 7.0, 1, 1.0);
}

TEST(FitSteps, StepsThatLeadNowhereAreRefusedWithTheirSize) {
  expect_misuse([] { (void)fit_steps(0.0, 1.0, 0.0); }, {"step size is 0"});
  expect_misuse([] { (void)fit_steps(0.0, 1.0, nan); }, {"step size is nan"});
  expect_misuse([] { (void)fit_steps(0.0, 1.0, -infinity); }, {"step size is -inf"});
  expect_misuse([] { (void)fit_steps(0.0, 1.0, -0.5); }, {"size -0.5", "t = 0", "t = 1"});
  expect_misuse([] { (void)fit_steps(3.0, 1.0, 0.5); }, {"size 0.5", "t = 3", "t = 1"});
  expect_misuse([] { (void)fit_steps(2.0, 2.0, 0.5); }, {"size 0.5", "t = 2"});
  expect_misuse([] { (void)fit_steps(0.0, nan, 0.5); }, {"size 0.5", "t = nan"});
}

TEST(FitSteps, TooSmallStepsAreRefusedWithTheirSize) {
  expect_misuse([] { (void)fit_steps(0.0, 1.0, 1e-20); }, {"too small", "1e-20"});
  expect_misuse([] { (void)fit_steps(0.0, 1.0, 5e-324); }, {"4.94066e-324"});
}

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
  const auto l_d = Registry::with_built_ins().method("type1/midpoint").make(*scene);
  Columns y(3, 2), g(3, 2);
  y << plus[1].q, plus[2].q;
  l_d->gradient({plus[1].time, options.step}, y, g);
  EXPECT_LT(distance(plus[2].p, g.col(1)), 1e-12);
  EXPECT_LT(distance(minus[1].p, -g.col(0)), 1e-12);
  EXPECT_GT(distance(minus[1].p, plus[1].p), 1e-4) << "the impulse vanishes, so nothing is tested";
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
        EXPECT_LT(distance(raw.p, projected.p), 1e-14);
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
      EXPECT_LT(distance(a.transpose() * lambda, difference), 1e-13) << scene->name;
      EXPECT_GT(difference.norm(), 1e-4) << "the momenta agree, so nothing is tested";
    }
}

TEST(Integrator, ReadingDoesNotChangeTheTrajectoryByABitAndCostsNoSolveOfAStep) {
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
  const RunReport report = run(integrator, 20, Momentum::minus, 1, [&](const Sample& sample) {
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

// --- Failure
// ----------------------------------------------------------------------------------------------------

/// A free particle on a circle of radius √(1 − t), which is gone after t = 1.
ScenePointer vanishing_circle() {
  Scene scene;
  scene.name = "vanishing circle";
  scene.coordinates = {"x", "y"};
  scene.lagrangian =
      lagrangian<2>([](const auto&, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]); });
  scene.constraints = {holonomic<2, 1>(
      []<class T>(const std::array<T, 2>& q, const T& t) {
        return std::array<T, 1>{q[0] * q[0] + q[1] * q[1] - 1.0 + t};
      },
      {"circle"})};
  scene.start = {0.0, Vector{{1.0, 0.0}}, Vector{{-0.5, 0.3}}};
  return std::make_shared<const Scene>(scene);
}

/// An oscillator whose potential is not a number after t = 1.
ScenePointer expiring_oscillator() {
  Scene scene;
  scene.name = "expiring oscillator";
  scene.coordinates = {"x"};
  scene.lagrangian = lagrangian<1>([](const auto& q, const auto& v, const auto& t) {
    using std::sqrt;
    return 0.5 * v[0] * v[0] - 0.5 * q[0] * q[0] * sqrt(1.0 - t);
  });
  scene.start = {0.0, Vector::Constant(1, 1.0), Vector::Constant(1, 0.5)};
  return std::make_shared<const Scene>(scene);
}

/// A separable scene whose force is not a number beyond x = 1.
ScenePointer edge_of_the_domain() {
  Scene scene;
  scene.name = "edge of the domain";
  scene.coordinates = {"x"};
  scene.lagrangian = lagrangian<1>([](const auto& q, const auto& v) {
    using std::sqrt;
    return 0.5 * v[0] * v[0] + sqrt(1.0 - q[0] * q[0]);
  });
  scene.start = {0.0, Vector::Constant(1, 0.5), Vector::Constant(1, 2.0)};
  return std::make_shared<const Scene>(scene);
}

/// Steps until one fails, which must be step number `step`, and checks that this one left no trace.
StepReport failing_step(Integrator& integrator, long step) {
  for (long k = 0; k < step; ++k) EXPECT_TRUE(integrator.step().ok()) << "step " << k;
  Sample before, after;
  EXPECT_TRUE(integrator.sample(Momentum::plus, before).ok());
  const StepReport report = integrator.step();
  EXPECT_FALSE(report.ok());
  EXPECT_EQ(report.step, step);
  EXPECT_EQ(report.time, before.time);
  EXPECT_EQ(integrator.position(), before.q);
  EXPECT_EQ(integrator.time(), before.time);
  EXPECT_EQ(integrator.work().steps, step);
  EXPECT_TRUE(integrator.sample(Momentum::plus, after).ok());
  EXPECT_EQ(after.p, before.p);
  EXPECT_LT(distance(after.v, before.v), 1e-14);
  return report;
}

TEST(Failure, StepWithoutASolutionNamesStepTimeAndResiduals) {
  Integrator integrator = integrator_for(vanishing_circle(), {.method = "type1/midpoint", .step = 0.4});
  const StepReport report = failing_step(integrator, 2);
  EXPECT_GT(report.solve.residual_norms[1], 0.2 - 1e-9);  // φ = x² + y² + 0.2 at the end of the step
  std::ostringstream residuals;
  residuals << "momentum residual " << report.solve.residual_norms[0] << ", constraint residual "
            << report.solve.residual_norms[1];
  expect_parts(report.failure,
               {"step 2", "t = 0.8", diracstep::describe(report.solve.status), residuals.str()});
}

TEST(Failure, StepThatDoesNotConvergeIsReported) {
  Integrator integrator(testing::mixed(), Registry::with_built_ins(), kinsol({.max_iterations = 1}),
                        {.method = "type1/midpoint", .step = 0.5});
  const StepReport report = failing_step(integrator, 0);
  EXPECT_EQ(report.solve.status, SolveStatus::no_convergence);
  EXPECT_GT(report.solve.residual_norms[0] + report.solve.residual_norms[1], 1e-6);
  expect_parts(report.failure, {"step 0", "t = 0:", "no convergence"});
}

TEST(Failure, FailedStepCanBeRepeatedAndFailsAgain) {
  Integrator integrator = integrator_for(vanishing_circle(), {.method = "type1/midpoint", .step = 0.4});
  const StepReport first = failing_step(integrator, 2), again = integrator.step();
  EXPECT_FALSE(again.ok());
  EXPECT_EQ(again.step, 2);
  EXPECT_EQ(again.time, first.time);
}

TEST(Failure, LaterStageLeavesTheMinusMomentumAsItWas) {
  // From t = 0.8 the first stages of order 6 end at 0.957 and at 1.090: the second one fails.
  Integrator integrator =
      integrator_for(vanishing_circle(), {.method = "type1/trapezoidal", .order = 6, .step = 0.4});
  for (int k = 0; k < 2; ++k) ASSERT_TRUE(integrator.step().ok());
  Sample before, after;
  ASSERT_TRUE(integrator.sample(Momentum::minus, before).ok());
  ASSERT_FALSE(integrator.step().ok());
  ASSERT_TRUE(integrator.sample(Momentum::minus, after).ok());
  EXPECT_EQ(after.q, before.q);
  EXPECT_LT(distance(after.p, before.p), 1e-13);
}

TEST(Failure, LagrangianThatIsNotANumberIsReported) {
  Integrator integrator = integrator_for(expiring_oscillator(), {.method = "type1/midpoint", .step = 0.3});
  const StepReport report = failing_step(integrator, 3);
  EXPECT_EQ(report.solve.status, SolveStatus::not_finite);
  EXPECT_TRUE(std::isnan(report.solve.residual_norms[0]));
  expect_parts(report.failure, {"step 3", "t = 0.9:", "not finite", "momentum residual nan"});
}

TEST(Failure, ExplicitStepOutOfTheDomainIsReported) {
  Integrator integrator = integrator_for(edge_of_the_domain(), {.method = "type1/trapezoidal", .step = 0.1});
  const StepReport report = failing_step(integrator, 2);
  EXPECT_EQ(report.solve.status, SolveStatus::not_finite);
  expect_parts(report.failure, {"step 2", "t = 0.2", "not finite"});
}

TEST(Failure, SingularJacobianIsReported) {
  // D1D2 L_d = -1/h + h/4 vanishes at h = 2.
  Scene scene;
  scene.name = "saddle";
  scene.coordinates = {"x"};
  scene.lagrangian =
      lagrangian<1>([](const auto& q, const auto& v) { return 0.5 * (v[0] * v[0] + q[0] * q[0]); });
  scene.start = {0.0, Vector{{1.0}}, Vector{{0.5}}};
  Integrator integrator =
      integrator_for(std::make_shared<const Scene>(scene), {.method = "type1/midpoint", .step = 2.0});
  const StepReport report = integrator.step();
  EXPECT_EQ(report.solve.status, SolveStatus::singular_jacobian);
  expect_parts(report.failure, {"step 0", "t = 0", "singular"});
}

TEST(Failure, RunKeepsWhatWasObservedBefore) {
  Integrator integrator = integrator_for(vanishing_circle(), {.method = "type1/midpoint", .step = 0.4});
  std::vector<double> times;
  const RunReport report = run(integrator, 10, Momentum::projected, 1, [&](const Sample& sample) {
    times.push_back(sample.time);
    return true;
  });
  EXPECT_FALSE(report.ok());
  EXPECT_EQ(times, (std::vector<double>{0.0, 0.4, 0.8}));
  EXPECT_EQ(report.last.step, 2);
  EXPECT_FALSE(report.last.failure.empty());
}

TEST(Failure, StateThatCannotBeReadIsReportedByRun) {
  // The third step is evaluated at its middle, t = 0.9375, and succeeds; its end is beyond t = 1.
  Integrator integrator = integrator_for(expiring_oscillator(), {.method = "type1/midpoint", .step = 0.375});
  std::vector<double> times;
  const RunReport report = run(integrator, 3, Momentum::projected, 1, [&](const Sample& sample) {
    times.push_back(sample.time);
    return true;
  });
  EXPECT_FALSE(report.ok());
  EXPECT_EQ(report.last.solve.status, SolveStatus::not_finite);
  EXPECT_EQ(times, (std::vector<double>{0.0, 0.375, 0.75}));
  expect_parts(report.last.failure, {"t = 1.125", "not finite"});
}

// --- Runs
// -------------------------------------------------------------------------------------------------------

TEST(Run, ShowsTheStartEveryKthPointAndTheLast) {
  const auto times_of = [](long steps, long every) {
    Integrator integrator = integrator_for(testing::nonholonomic(), {.step = 0.125});
    std::vector<double> times;
    EXPECT_TRUE(run(integrator, steps, Momentum::plus, every, [&](const Sample& sample) {
                  times.push_back(sample.time / 0.125);
                  return true;
                }).ok());
    EXPECT_EQ(integrator.work().steps, steps);
    return times;
  };
  EXPECT_EQ(times_of(5, 2), (std::vector<double>{0, 2, 4, 5}));
  EXPECT_EQ(times_of(4, 2), (std::vector<double>{0, 2, 4}));
  EXPECT_EQ(times_of(3, 10), (std::vector<double>{0, 3}));
  EXPECT_EQ(times_of(0, 1), (std::vector<double>{0}));
}

TEST(Run, EndsWhereTheObserverSaysSo) {
  Integrator integrator = integrator_for(testing::nonholonomic(), {.step = 0.125});
  int shown = 0;
  EXPECT_TRUE(run(integrator, 10, Momentum::plus, 1, [&](const Sample&) { return ++shown < 4; }).ok());
  EXPECT_EQ(shown, 4);
  EXPECT_EQ(integrator.work().steps, 3);
}

TEST(Run, KeepingLessThanEveryPointIsRefusedBeforeAnythingIsDone) {
  Integrator integrator = integrator_for(testing::nonholonomic(), {.step = 0.125});
  for (const long every : {0L, -3L})
    expect_misuse(
        [&] {
          (void)run(integrator, 2, Momentum::plus, every, [](const Sample&) {
            ADD_FAILURE() << "a point was shown";
            return true;
          });
        },
        {"every = " + std::to_string(every), "1 or more"});
  EXPECT_EQ(integrator.work().steps, 0);
}

// --- Accuracy
// ---------------------------------------------------------------------------------------------------

TEST(Integrator, SparseAndFullMatricesAgree) {
  for (const auto& scene : testing::every_constraint_class())
    for (IntegratorOptions options : every_kind_of_step()) {
      const Sample full = samples_of(scene, options, 20).back();
      options.dense_limit = 0;
      const Sample sparse = samples_of(scene, options, 20).back();
      EXPECT_LT(distance(full.q, sparse.q), 1e-12) << describe(scene, options);
      EXPECT_LT(distance(full.p, sparse.p), 1e-12) << describe(scene, options);
      EXPECT_LT(distance(full.v, sparse.v), 1e-12) << describe(scene, options);
      if (scene->rows() == 0) continue;
      EXPECT_LT(distance(full.lambda, sparse.lambda), 1e-11) << describe(scene, options);
    }
}

/// log2 of the ratio of the errors in (q, projected p) at t = 2 with `steps` and twice as many steps.
double composed_order(const ScenePointer& scene, int order, long steps, const Sample& reference) {
  const auto error = [&](long count) {
    const IntegratorOptions options{.method = "type1/midpoint", .order = order, .step = 2.0 / double(count)};
    const Sample end = samples_of(scene, options, count).back();
    return distance(join(end.q, end.p), join(reference.q, reference.p));
  };
  const double coarse = error(steps), fine = error(2 * steps);
  EXPECT_GT(fine, 1e-12) << "round-off of the reference";
  return std::log2(coarse / fine);
}

TEST(Integrator, CompositionsHaveTheirOrderUnderConstraints) {
  const std::map<int, long> steps{{2, 40}, {4, 10}, {6, 7}, {8, 5}};
  for (const auto& scene : {testing::nonholonomic(), testing::holonomic_sphere(), testing::mixed()}) {
    const Sample reference = samples_of(scene, {.method = "type1/gl:4", .step = 1.0 / 128.0}, 256).back();
    for (const auto& [order, count] : steps)
      EXPECT_NEAR(composed_order(scene, order, count, reference), order, 0.2)
          << scene->name << ", order " << order;
  }
}

TEST(Integrator, StepForwardAndBackReturnsToTheProjectedStart) {
  const std::vector<IntegratorOptions> self_adjoint{{.method = "type1/midpoint", .step = 0.05},
                                                    {.method = "type1/trapezoidal", .step = 0.05},
                                                    {.method = "type1/midpoint", .order = 8, .step = 0.05},
                                                    {.method = "type1/left", .order = 2, .step = 0.05},
                                                    {.method = "type2/euler", .order = 4, .step = 0.05},
                                                    {.method = "type1/gl:3", .step = 0.05}};
  for (const auto& scene : testing::every_constraint_class())
    for (IntegratorOptions options : self_adjoint) {
      const auto forward = samples_of(scene, options, 1);
      auto turned = std::make_shared<Scene>(*scene);
      turned->start = {forward[1].time, forward[1].q, forward[1].v};
      options.step = -options.step;
      const Sample back = samples_of(turned, options, 1).back();
      EXPECT_EQ(back.time, 0.0);
      EXPECT_LT(distance(back.q, forward[0].q), 1e-13) << describe(scene, options);
      EXPECT_LT(distance(back.p, forward[0].p), 1e-12) << describe(scene, options);
    }
}

TEST(Integrator, SeparableTrapezoidalStepIsVelocityVerletWithoutASolve) {
  Scene scene = testing::particle("separable");
  const Vector mass{{1.0, 2.0, 0.5}};
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + 2.0 * v[1] * v[1] + 0.5 * v[2] * v[2]) - q[0] * q[0] * q[1] * q[1] -
           q[2] * q[2];
  });
  const auto force = [](const Vector& q) {
    return Vector{{-2.0 * q[0] * q[1] * q[1], -2.0 * q[0] * q[0] * q[1], -2.0 * q[2]}};
  };
  const double h = 0.05;
  Integrator integrator =
      integrator_for(std::make_shared<const Scene>(scene), {.method = "type1/trapezoidal", .step = h});
  Vector q = scene.start.q, v = scene.start.v;
  Sample sample;
  for (int k = 0; k < 50; ++k) {
    v += h / 2.0 * force(q).cwiseQuotient(mass);
    q += h * v;
    v += h / 2.0 * force(q).cwiseQuotient(mass);
    ASSERT_TRUE(integrator.step().ok());
    ASSERT_TRUE(integrator.sample(Momentum::projected, sample).ok());
    EXPECT_LT(distance(sample.q, q), 1e-14);
    EXPECT_LT(distance(sample.v, v), 1e-13);
  }
  EXPECT_EQ(integrator.work().solves, 0);
  EXPECT_EQ(integrator.work().iterations, 0);
  EXPECT_EQ(integrator.work().steps, 50);
}

/// Checks the order of the error against `exact`, which gives (q, v, Λ) at a time, for steps and compositions
/// of them.
template <class Exact>
void expect_stated_orders(const ScenePointer& scene, double end, Exact exact) {
  for (const IntegratorOptions& options :
       {IntegratorOptions{.method = "type1/midpoint", .order = 2, .step = 0.02},
        {.method = "type1/trapezoidal", .order = 2, .step = 0.02},
        {.method = "type2/legendre(type1/midpoint)", .order = 2, .step = 0.02},
        {.method = "type1/left", .order = 2, .step = 0.02},
        {.method = "type2/euler", .order = 4, .step = 0.05},
        {.method = "type1/midpoint", .order = 4, .step = 0.1},
        {.method = "type1/trapezoidal", .order = 4, .step = 0.1},
        {.method = "type1/gl:2", .order = 4, .step = 0.1}}) {
    const auto error = [&](double h) {
      const StepGrid grid = fit_steps(0.0, end, h);
      IntegratorOptions fitted = options;
      fitted.step = grid.step;
      const Sample last = samples_of(scene, fitted, grid.steps).back();
      return distance(join(join(last.q, last.v), last.lambda), exact(last.time));
    };
    const double coarse = error(options.step), fine = error(options.step / 2.0);
    EXPECT_NEAR(std::log2(coarse / fine), options.order, 0.1) << describe(scene, options);
    EXPECT_LT(fine, 1e-3) << describe(scene, options);
  }
}

TEST(Integrator, DampedOscillatorFromATimeDependentLagrangianConvergesWithTheStatedOrders) {
  // L = e^{2ct} (v² − q²) / 2 gives q'' + 2c q' + q = 0.
  const double c = 0.1, w = std::sqrt(1.0 - c * c);
  Scene scene;
  scene.name = "damped oscillator";
  scene.coordinates = {"x"};
  scene.lagrangian = lagrangian<1>([c](const auto& q, const auto& v, const auto& t) {
    using std::exp;
    return exp(2.0 * c * t) * 0.5 * (v[0] * v[0] - q[0] * q[0]);
  });
  scene.start = {0.0, Vector::Constant(1, 1.0), Vector::Constant(1, -c)};
  expect_stated_orders(std::make_shared<const Scene>(scene), 3.0, [=](double t) {
    const double decay = std::exp(-c * t);
    return Vector{{decay * std::cos(w * t), decay * (-c * std::cos(w * t) - w * std::sin(w * t))}};
  });
}

TEST(Integrator, BeadOnATurningLineConvergesWithTheStatedOrders) {
  // φ = y cos ωt − x sin ωt: r = r0 cosh ωt along the line, Λ = 2 ω r'.
  const double w = 1.3, r0 = 0.4;
  Scene scene;
  scene.name = "turning line";
  scene.coordinates = {"x", "y"};
  scene.lagrangian =
      lagrangian<2>([](const auto&, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]); });
  scene.constraints = {holonomic<2, 1>([w]<class T>(const std::array<T, 2>& q, const T& t) {
    using std::cos, std::sin;
    return std::array<T, 1>{q[1] * cos(w * t) - q[0] * sin(w * t)};
  })};
  scene.start = {0.0, Vector{{r0, 0.0}}, Vector{{0.0, r0 * w}}};
  expect_stated_orders(std::make_shared<const Scene>(scene), 1.5, [=](double t) {
    const double r = r0 * std::cosh(w * t), rate = r0 * w * std::sinh(w * t);
    const double c = std::cos(w * t), s = std::sin(w * t);
    return Vector{{r * c, r * s, rate * c - r * w * s, rate * s + r * w * c, 2.0 * w * rate}};
  });
}

TEST(Integrator, BeltThatMovesUnderAParticleConvergesWithTheStatedOrders) {
  Scene scene;
  scene.name = "belt";
  scene.coordinates = {"x", "y"};
  scene.lagrangian =
      lagrangian<2>([](const auto&, const auto& v) { return 0.5 * (v[0] * v[0] + v[1] * v[1]); });
  // v_y − x v_x = t: with x' = u,  u' = −Λ x,  y'' = Λ; so Λ = (u² + 1) / (1 + x²).
  scene.constraints = {affine<2, 1>(
      []<class T>(const std::array<T, 2>& q) {
        return std::array<std::array<T, 2>, 1>{{{-q[0], T(1.0)}}};
      },
      []<class T>(const std::array<T, 2>&, const T& t) { return std::array<T, 1>{-t}; })};
  scene.start = {0.0, Vector{{0.3, 0.0}}, Vector{{0.8, 0.24}}};
  const auto shared = std::make_shared<const Scene>(scene);
  // The reduced equation for (x, u), integrated far more finely by the classical Runge–Kutta method.
  expect_stated_orders(shared, 1.5, [](double t) {
    const int steps = 2000;
    const double h = t / steps;
    using State = Eigen::Vector3d;  // x, u, y
    const auto force = [](double x, double u) { return (u * u + 1.0) / (1.0 + x * x); };
    const auto rate = [&](double time, const State& s) {
      return State(s[1], -force(s[0], s[1]) * s[0], s[0] * s[1] + time);
    };
    State s(0.3, 0.8, 0.0);
    for (int k = 0; k < steps; ++k) {
      const double now = k * h;
      const State a = rate(now, s), b = rate(now + h / 2.0, s + h / 2.0 * a),
                  c = rate(now + h / 2.0, s + h / 2.0 * b), d = rate(now + h, s + h * c);
      s += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
    }
    return Vector{{s[0], s[2], s[1], s[0] * s[1] + t, force(s[0], s[1])}};
  });
}

TEST(Integrator, SmoothScenesTakeAtMostTwoIterationsASolve) {
  for_every_combination([](const ScenePointer& scene, IntegratorOptions options) {
    options.step = 0.01;
    Integrator integrator = integrator_for(scene, options);
    ASSERT_TRUE(run(integrator, 200, Momentum::plus, 1, nullptr).ok());
    EXPECT_LE(integrator.work().iterations, 2 * integrator.work().solves);
    EXPECT_GE(integrator.work().solves, 200);
  });
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
  EXPECT_EQ(decision(testing::unconstrained(), options, "unknowns"), "q1 (3)");
  EXPECT_EQ(decision(testing::mixed(), options, "unknowns"), "q1 (3), multipliers (2)");
  EXPECT_EQ(decision(testing::mixed(), {.method = "type1/midpoint", .step = 0.1}, "unknowns"),
            "stage velocities (3), multipliers (2)");
  EXPECT_EQ(decision(testing::mixed(), options, "Jacobian"), "full");
  expect_parts(decision(testing::mixed(), options, "nonlinear solver"), {"KINSOL", "dense"});
  const IntegratorOptions sparse{.method = "type1/trapezoidal", .step = 0.1, .dense_limit = 0};
  EXPECT_EQ(decision(testing::mixed(), sparse, "Jacobian"), "sparse");
}

TEST(Plan, ExplicitStepsLeaveOutTheSolver) {
  const IntegratorOptions options{.method = "type1/trapezoidal", .step = 0.1};
  EXPECT_EQ(decision(edge_of_the_domain(), options, "nonlinear solver"), "left out");
  EXPECT_EQ(decision(edge_of_the_domain(), options, "unknowns"), "none");
  EXPECT_EQ(decision(edge_of_the_domain(), options, "Jacobian"), "no line");
  EXPECT_NE(decision(testing::unconstrained(), options, "nonlinear solver"), "left out");
}

}  // namespace
}  // namespace diracstep
