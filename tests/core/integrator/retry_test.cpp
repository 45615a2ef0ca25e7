#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/runs/run.hpp>
#include <limits>

#include "combinations.hpp"
#include "misuse.hpp"
#include "stepping.hpp"

/// What happens where Newton's method from the first guess does not do: retries, other solutions, divided
/// steps, and that a failure leaves no trace.
namespace diracstep {
namespace {

using testing::expect_misuse;
using testing::expect_parts;
using testing::integrator_for;
using testing::same_bits;
using testing::ScenePointer;

/// Two bodies at the pericentre of an orbit of eccentricity 0.6.
ScenePointer kepler() {
  Scene scene;
  scene.name = "kepler";
  scene.coordinates = {"x", "y"};
  scene.lagrangian = lagrangian<2>([](const auto& q, const auto& v) {
    using std::sqrt;
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) + 1.0 / sqrt(q[0] * q[0] + q[1] * q[1]);
  });
  scene.start = {0.0, Vector{{0.4, 0.0}}, Vector{{0.0, 2.0}}};
  return std::make_shared<const Scene>(scene);
}

/// A pendulum of period 2, released from the horizontal.
ScenePointer pendulum() {
  Scene scene;
  scene.name = "pendulum";
  scene.coordinates = {"x", "y"};
  scene.lagrangian = lagrangian<2>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) - 13.750371636040745 * q[1];
  });
  scene.constraints = {holonomic<2, 1>(
      []<class T>(const std::array<T, 2>& q) { return std::array<T, 1>{q[0] * q[0] + q[1] * q[1] - 1.0}; })};
  scene.start = {0.0, Vector{{1.0, 0.0}}, Vector::Zero(2)};
  return std::make_shared<const Scene>(scene);
}

// --- Other solutions
// --------------------------------------------------------------------------------------------

TEST(OtherSolution, FreeFlightPastTheCentreIsRefused) {
  // Steps of many periods have a solution next to a straight line, which no small step leads to.
  for (const double h : {2.0, 5.0, 50.0, 5000.0}) {
    Integrator integrator = integrator_for(kepler(), {.method = "type1/midpoint", .step = h});
    const StepReport report = integrator.step();
    EXPECT_EQ(report.solve.status, SolveStatus::other_branch) << h;
    expect_parts(report.failure, {"step 0 from t = 0", "smaller steps lead to", "can be followed up to"});
    EXPECT_EQ(integrator.position(), kepler()->start.q);
  }
}

/// Largest change of the energy over a run to t = 29.7.
double energy_change(Integrator& integrator, double h) {
  const StepGrid grid = fit_steps(0.0, 29.7, h);
  double largest = 0.0;
  const RunReport report =
      run_steps(integrator, grid.steps, Momentum::projected, 1, [&](const Sample& sample) {
        largest = std::max(largest, std::abs(sample.energy));
        return true;
      });
  EXPECT_TRUE(report.ok()) << report.last.failure;
  return largest;
}

TEST(OtherSolution, IsReplacedByTheOneSmallerStepsLeadTo) {
  // A tenth of the period: Newton's method from the predicted guess goes astray now and then, and with it the
  // energy by about 1.
  const double h = 29.7 / 149.0;
  Integrator integrator = integrator_for(pendulum(), {.method = "type1/gl:6", .step = h});
  EXPECT_LT(energy_change(integrator, h), 1e-6);
  EXPECT_GE(integrator.work().retries.other_branches, 1);
}

TEST(OtherSolution, SmoothMotionsAreNotLookedAtTwice) {
  for (const auto& scene : testing::every_constraint_class())
    for (const IntegratorOptions& options : testing::every_kind_of_step()) {
      Integrator integrator = integrator_for(scene, options);
      ASSERT_TRUE(run_steps(integrator, 100, Momentum::plus, 1, nullptr).ok());
      EXPECT_EQ(integrator.work().retries.total(), 0) << testing::describe(scene, options);
    }
}

// --- The ladder
// -------------------------------------------------------------------------------------------------

/// Gives up the next solves on demand, whatever they would come to.
class Unreliable final : public NonlinearSolver {
 public:
  Unreliable(std::unique_ptr<NonlinearSolver> solver, int& failures, std::vector<Vector>& guesses)
      : solver_(std::move(solver)), failures_(failures), guesses_(guesses) {}

  SolveReport solve(VectorRef x) override {
    guesses_.emplace_back(x);
    if (failures_ <= 0) return solver_->solve(x);
    --failures_;
    x.setConstant(1e3);
    return {.status = SolveStatus::no_convergence};
  }
  std::string description() const override { return "unreliable"; }

 private:
  std::unique_ptr<NonlinearSolver> solver_;
  int& failures_;
  std::vector<Vector>& guesses_;
};

struct LadderTest : ::testing::Test {
  int failures = 0;
  std::vector<Vector> guesses;
  int solvers = 0;
  Integrator integrator{pendulum(),
                        Registry::with_built_ins(),
                        [this](NonlinearProblem& problem) -> std::unique_ptr<NonlinearSolver> {
                          auto solver = kinsol()(problem);
                          // The step's own solver is made after that of the velocity.
                          if (++solvers != 2) return solver;
                          return std::make_unique<Unreliable>(std::move(solver), failures, guesses);
                        },
                        {.method = "type1/gl:2", .step = 0.02}};

  /// The seventh step, the first `count` solves of which fail; the retries it took.
  Retries seventh_step(int count) {
    for (int k = 0; k < 6; ++k) EXPECT_TRUE(integrator.step().ok());
    EXPECT_EQ(integrator.work().retries.total(), 0);
    guesses.clear();
    failures = count;
    EXPECT_TRUE(integrator.step().ok());
    Integrator undisturbed = integrator_for(pendulum(), integrator.options());
    for (int k = 0; k < 7; ++k) EXPECT_TRUE(undisturbed.step().ok());
    EXPECT_LT(testing::distance(integrator.position(), undisturbed.position()), 1e-13);
    return integrator.work().retries;
  }
};

TEST_F(LadderTest, FirstThePlainGuess) {
  const Retries retries = seventh_step(1);
  EXPECT_EQ(retries.plain_guesses, 1);
  EXPECT_EQ(retries.previous_solutions, 0);
  EXPECT_EQ(retries.other_branches, 0);
  ASSERT_GE(guesses.size(), 2u);
  EXPECT_EQ(guesses[1].segment(0, 2), guesses[1].segment(2, 2)) << "one velocity in both stages";
}

TEST_F(LadderTest, ThenTheLastSolution) {
  const Retries retries = seventh_step(2);
  EXPECT_EQ(retries.plain_guesses, 1);
  EXPECT_EQ(retries.previous_solutions, 1);
  ASSERT_GE(guesses.size(), 3u);
  EXPECT_NE(guesses[2].segment(0, 2), guesses[2].segment(2, 2));
}

TEST_F(LadderTest, ThenTheSolutionIsFollowedFromSmallSteps) {
  const Retries retries = seventh_step(3);
  EXPECT_EQ(retries.plain_guesses, 1);
  EXPECT_EQ(retries.previous_solutions, 1);
  EXPECT_EQ(retries.continuations, 1);
  EXPECT_EQ(retries.divided_steps, 0);
}

TEST_F(LadderTest, AndThenTheStepFails) {
  for (int k = 0; k < 6; ++k) EXPECT_TRUE(integrator.step().ok());
  failures = 1000;
  const StepReport report = integrator.step();
  EXPECT_EQ(report.solve.status, SolveStatus::no_convergence);
  EXPECT_EQ(report.step, 6);
}

// --- Smaller steps
// ----------------------------------------------------------------------------------------------

TEST(Substeps, AreTakenWhereTheWholeStepHasNoSolution) {
  // From the pericentre the midpoint step has a solution up to h = 0.246.
  const IntegratorOptions whole{.method = "type1/midpoint", .step = 0.3};
  Integrator stuck = integrator_for(kepler(), whole);
  EXPECT_FALSE(stuck.step().ok());
  IntegratorOptions allowed = whole;
  allowed.substeps = 8;
  Integrator divided = integrator_for(kepler(), allowed);
  ASSERT_TRUE(divided.step().ok());
  EXPECT_EQ(divided.work().retries.divided_steps, 1);
  EXPECT_EQ(divided.work().steps, 1);
  EXPECT_EQ(divided.time(), 0.3);
  IntegratorOptions half = whole;
  half.step = 0.15;
  Integrator smaller = integrator_for(kepler(), half);
  ASSERT_TRUE(smaller.step().ok());
  ASSERT_TRUE(smaller.step().ok());
  EXPECT_LT(testing::distance(divided.position(), smaller.position()), 1e-13);
  for (int k = 0; k < 5; ++k) EXPECT_TRUE(divided.step().ok()) << k;  // and the run goes on
}

TEST(Substeps, TooFewAreAFailureThatNamesTheWholeStep) {
  Integrator integrator = integrator_for(kepler(), {.method = "type1/midpoint", .step = 5.0, .substeps = 4});
  const StepReport report = integrator.step();
  EXPECT_FALSE(report.ok());
  expect_parts(report.failure, {"step 0 from t = 0"});
  EXPECT_EQ(integrator.work().retries.divided_steps, 0);
  EXPECT_EQ(integrator.position(), kepler()->start.q);
  EXPECT_EQ(integrator.time(), 0.0);
}

TEST(Substeps, FewerThanOneAreRefused) {
  for (const int substeps : {0, -3})
    expect_misuse([&] { (void)integrator_for(kepler(), {.step = 0.1, .substeps = substeps}); },
                  {"substeps = " + std::to_string(substeps), "1 or more"});
}

// --- Failures leave no trace
// ------------------------------------------------------------------------------------

/// The scene with a potential that is not a number while `sick`.
ScenePointer sick_scene(const ScenePointer& scene, const std::shared_ptr<bool>& sick) {
  auto copy = std::make_shared<Scene>(*scene);
  copy->lagrangian = lagrangian<3>([sick](const auto& q, const auto& v) {
    using std::cos;
    const double poison = *sick ? std::numeric_limits<double>::quiet_NaN() : 0.1;
    return 0.5 * (v[0] * v[0] + 1.3 * v[1] * v[1] + (1.0 + 0.2 * cos(q[0])) * v[2] * v[2]) -
           0.4 * q[0] * q[0] - poison * q[1] * q[2] * q[2];
  });
  return copy;
}

TEST(FailedStep, LeavesNoTraceInTheStepsAfterIt) {
  for (const auto& scene : testing::every_constraint_class())
    for (const IntegratorOptions& options : testing::every_kind_of_step()) {
      SCOPED_TRACE(testing::describe(scene, options));
      const auto sick = std::make_shared<bool>(false);
      const auto shared = sick_scene(scene, sick);
      Integrator disturbed = integrator_for(shared, options), undisturbed = integrator_for(shared, options);
      for (int k = 0; k < 6; ++k) {
        *sick = true;
        const bool failed = !disturbed.step().ok();
        *sick = false;
        EXPECT_TRUE(failed);
        EXPECT_EQ(disturbed.position(), undisturbed.position());
        EXPECT_EQ(disturbed.time(), undisturbed.time());
        ASSERT_TRUE(disturbed.step().ok());
        ASSERT_TRUE(undisturbed.step().ok());
      }
      Sample a, b;
      ASSERT_TRUE(disturbed.sample(Momentum::minus, a).ok());
      ASSERT_TRUE(undisturbed.sample(Momentum::minus, b).ok());
      EXPECT_TRUE(same_bits(a, b));
      EXPECT_GT(disturbed.work().solves, undisturbed.work().solves) << "the failures were not counted";
    }
}

}  // namespace
}  // namespace diracstep
