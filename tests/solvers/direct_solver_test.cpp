#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/solvers/direct_solver.hpp>

namespace diracstep {
namespace {

/// g(x) = target in one unknown, with the unit matrix as splitting where it has one.
class OneUnknown final : public NonlinearProblem {
 public:
  using Function = double (*)(double);
  OneUnknown(Function function, Function derivative, bool splitting)
      : function_(function), derivative_(derivative), splitting_(splitting) {}

  int size() const override { return 1; }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return {&block_, 1}; }
  void residual(ConstVectorRef x, VectorRef f) override { f[0] = function_(x[0]) - target; }
  void jacobian(ConstVectorRef x, VectorRef values) override {
    ++jacobians;
    values[0] = derivative_(x[0]);
  }
  bool has_splitting() const override { return splitting_; }
  void solve_splitting(VectorRef) override {}

  double target = 0.0;
  int jacobians = 0;

 private:
  Function function_, derivative_;
  bool splitting_;
  SparsityPattern pattern_ = SparsityPattern::dense(1, 1);
  ResidualBlock block_{"row", 1};
};

double weakly_bent(double x) { return x + 0.1 * std::sin(x); }
double slope_of_weakly_bent(double x) { return 1.0 + 0.1 * std::cos(x); }
double steep(double x) { return 3.0 * x + x * x * x; }
double slope_of_steep(double x) { return 3.0 + 3.0 * x * x; }
double arc_tangent(double x) { return std::atan(x); }
double slope_of_arc_tangent(double x) { return 1.0 / (1.0 + x * x); }

TEST(Direct, RepeatsTheSplittingWhereItContracts) {
  OneUnknown problem(weakly_bent, slope_of_weakly_bent, true);
  problem.target = 1.0;
  const auto solver = direct()(problem);
  Vector x = Vector::Zero(1);
  const SolveReport report = solver->solve(x);
  EXPECT_TRUE(report.ok());
  EXPECT_NEAR(weakly_bent(x[0]), 1.0, 4e-15);
  EXPECT_EQ(problem.jacobians, 0);
  EXPECT_GT(report.iterations, 4);
  EXPECT_EQ(report.residual_evaluations, report.iterations + 1);
  EXPECT_LT(report.residual_norms[0], 4e-15);
}

TEST(Direct, GoesOnWithNewtonsMethodWhereItDoesNot) {
  OneUnknown problem(steep, slope_of_steep, true);
  problem.target = 4.0;
  const auto solver = direct()(problem);
  Vector x = Vector::Zero(1);
  EXPECT_TRUE(solver->solve(x).ok());
  EXPECT_NEAR(x[0], 1.0, 1e-14);
  EXPECT_GT(problem.jacobians, 0);
}

/// Once the solves that are judged have taken more iterations than all twelve may, as here after seven:
/// Newton's method takes its first residual at the guess, and the splitting is not tried any more.
TEST(Direct, GivesUpASplittingThatFailsOnceAndForAll) {
  OneUnknown problem(steep, slope_of_steep, true);
  const auto solver = direct()(problem);
  int before = 0, after = 0;
  for (int k = 0; k < 11; ++k) {
    Vector x = Vector::Zero(1);
    problem.target = 4.0 + 0.01 * k;
    const SolveReport report = solver->solve(x);
    EXPECT_TRUE(report.ok());
    EXPECT_NEAR(steep(x[0]), problem.target, 1e-14 * problem.target);
    (k == 0 ? before : after) = report.residual_evaluations;
  }
  EXPECT_LT(after, before);
  solver->reset();
  Vector x = Vector::Zero(1);
  problem.target = 4.0;
  EXPECT_EQ(solver->solve(x).residual_evaluations, before);
}

/// Newton's method with full steps leaves arc tangents of 0 from 2 on; KINSOL's line search does not.
TEST(Direct, LeavesToKinsolWhatItDoesNotSolve) {
  for (const bool splitting : {false, true}) {
    OneUnknown problem(arc_tangent, slope_of_arc_tangent, splitting);
    const auto solver = direct({.iteration = Iteration::newton})(problem);
    Vector x = Vector::Constant(1, 2.0);
    const SolveReport report = solver->solve(x);
    EXPECT_TRUE(report.ok());
    EXPECT_GT(report.line_searches, 0);
    EXPECT_NEAR(x[0], 0.0, 1e-15);
  }
}

TEST(Direct, SaysWhyItFailed) {
  OneUnknown flat([](double) { return 1.0; }, [](double) { return 0.0; }, false);
  OneUnknown undefined([](double x) { return std::log(x - 10.0); }, [](double x) { return 1.0 / (x - 10.0); },
                       true);
  Vector x = Vector::Zero(1);
  EXPECT_EQ(direct()(flat)->solve(x).status, SolveStatus::singular_jacobian);
  x.setZero();
  EXPECT_EQ(direct()(undefined)->solve(x).status, SolveStatus::not_finite);
}

TEST(Direct, IsChosenByName) {
  OneUnknown problem(weakly_bent, slope_of_weakly_bent, true);
  EXPECT_NE(named_solver("direct")(problem)->description().find("direct"), std::string::npos);
  EXPECT_EQ(named_solver("newton")(problem)->description().find("direct"), std::string::npos);
  EXPECT_NE(named_solver("automatic")(problem)->strategy().find("fixed-point"), std::string::npos);
  try {
    (void)named_solver("kinsol");
    FAIL();
  } catch (const Misuse& misuse) {
    for (const char* part : {"kinsol", "newton", "automatic", "direct"})
      EXPECT_NE(std::string(misuse.what()).find(part), std::string::npos) << misuse.what();
  }
}

}  // namespace
}  // namespace diracstep
