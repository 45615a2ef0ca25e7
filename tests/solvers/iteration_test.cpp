#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <limits>

namespace diracstep {
namespace {

/// u_i + coupling · (u_{i+1})² = b_i, which is affine for a coupling of 0, with the unit matrix as splitting.
class Ring final : public NonlinearProblem {
 public:
  Ring(int size, double coupling) : coupling_(coupling), right_side_(Vector::LinSpaced(size, 0.5, 1.5)) {}

  int size() const override { return static_cast<int>(right_side_.size()); }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return {&block_, 1}; }
  void residual(ConstVectorRef x, VectorRef f) override {
    for (Eigen::Index i = 0; i < x.size(); ++i)
      f[i] = scale * x[i] + coupling_ * x[next(i)] * x[next(i)] - right_side_[i];
  }
  void jacobian(ConstVectorRef x, VectorRef values) override {
    ++jacobians;
    values.setZero();
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      values[i + i * x.size()] = scale;
      values[i + next(i) * x.size()] += 2.0 * coupling_ * x[next(i)];
    }
  }
  double constant_jacobian_parameter() const override {
    return coupling_ == 0.0 ? scale : std::numeric_limits<double>::quiet_NaN();
  }
  bool has_splitting() const override { return true; }
  void solve_splitting(VectorRef) override { ++splittings; }

  double residual_norm(const Vector& x) {
    Vector f(x.size());
    residual(x, f);
    return f.lpNorm<Eigen::Infinity>();
  }

  void turn(double angle) { right_side_.array() += 0.001 * std::sin(angle); }

  double scale = 1.0;
  int jacobians = 0, splittings = 0;

 private:
  Eigen::Index next(Eigen::Index i) const { return (i + 1) % right_side_.size(); }

  double coupling_;
  Vector right_side_;
  SparsityPattern pattern_ = SparsityPattern::dense(size(), size());
  ResidualBlock block_{"rows", size()};
};

struct Work {
  int jacobians;
  long iterations;
  Vector x;
};

/// Thirty solves of a problem that changes a little from one to the next.
Work thirty_solves(double coupling, KinsolOptions options) {
  Ring problem(6, coupling);
  const auto solver = kinsol(options)(problem);
  Work work{0, 0, Vector::Zero(6)};
  for (int k = 0; k < 30; ++k) {
    problem.turn(0.2 * k);
    const SolveReport report = solver->solve(work.x);
    EXPECT_TRUE(report.ok());
    EXPECT_LT(problem.residual_norm(work.x), 2e-14);
    work.iterations += report.iterations;
  }
  work.jacobians = problem.jacobians;
  return work;
}

TEST(JacobianPolicy, DecidesHowManyJacobiansAreTakenAndNothingElse) {
  const Work fresh = thirty_solves(0.1, {.jacobian = JacobianPolicy::fresh});
  const Work per_step = thirty_solves(0.1, {.jacobian = JacobianPolicy::per_step});
  const Work kept = thirty_solves(0.1, {.jacobian = JacobianPolicy::kept});
  EXPECT_EQ(fresh.jacobians, fresh.iterations);
  EXPECT_LE(per_step.jacobians, 32);
  EXPECT_GE(per_step.jacobians, 30);
  EXPECT_LE(kept.jacobians, 4);
  EXPECT_GT(kept.iterations, fresh.iterations);
  EXPECT_LT((fresh.x - kept.x).lpNorm<Eigen::Infinity>(), 2e-14);
  EXPECT_LT((fresh.x - per_step.x).lpNorm<Eigen::Infinity>(), 2e-14);
}

TEST(JacobianPolicy, ConstantJacobianIsFactoredOnceForEachParameter) {
  Ring problem(6, 0.0);
  const auto solver = kinsol()(problem);
  Vector x = Vector::Zero(6);
  for (int k = 0; k < 30; ++k) {
    problem.scale = k % 3 == 0 ? 2.0 : 0.5;
    problem.turn(k);
    EXPECT_TRUE(solver->solve(x).ok());
    EXPECT_LT(problem.residual_norm(x), 1e-14) << k;
  }
  EXPECT_EQ(problem.jacobians, 2);
  solver->reset();
  x.setZero();
  EXPECT_TRUE(solver->solve(x).ok());
  EXPECT_EQ(problem.jacobians, 3);
  EXPECT_NE(solver->strategy().find("constant"), std::string::npos);
}

TEST(JacobianPolicy, SingularFactorsOfOneParameterAreNotTakenAfterThoseOfAnother) {
  Ring problem(6, 0.0);
  const auto solver = kinsol()(problem);
  Vector x = Vector::Zero(6);
  for (int k = 0; k < 3; ++k) {
    problem.scale = 0.0;
    EXPECT_EQ(solver->solve(x).status, SolveStatus::singular_jacobian) << k;
    problem.scale = 0.5;
    EXPECT_TRUE(solver->solve(x).ok()) << k;
    EXPECT_LT(problem.residual_norm(x), 1e-14) << k;
  }
}

TEST(JacobianPolicy, KeptJacobianIsReplacedWhereItFails) {
  Ring problem(6, 0.05);
  const auto solver = kinsol({.jacobian = JacobianPolicy::kept})(problem);
  Vector x = Vector::Zero(6);
  EXPECT_TRUE(solver->solve(x).ok());
  problem.scale = 4.0;  // the kept one would take four times too long a step
  const SolveReport report = solver->solve(x);
  EXPECT_TRUE(report.ok());
  EXPECT_LE(report.iterations, 8);
  EXPECT_GE(report.jacobian_evaluations, 1);
  EXPECT_LT(problem.residual_norm(x), 2e-14);
}

TEST(FixedPoint, ConvergesWithoutJacobiansWhereTheSplittingIsNear) {
  for (const int anderson : {0, 3}) {
    const Work work = thirty_solves(0.02, {.iteration = Iteration::fixed_point, .anderson = anderson});
    EXPECT_EQ(work.jacobians, 0) << anderson;
    EXPECT_GT(work.iterations, 90) << "too few for a fixed-point iteration";
    const Work newton = thirty_solves(0.02, {});
    EXPECT_LT((work.x - newton.x).lpNorm<Eigen::Infinity>(), 4e-15) << anderson;
  }
}

TEST(FixedPoint, GivesWayToNewtonWhereItDiverges) {
  Ring problem(6, 0.02);
  problem.scale = 3.0;
  const auto solver = kinsol({.iteration = Iteration::fixed_point})(problem);
  Vector x = Vector::Zero(6);
  const SolveReport report = solver->solve(x);
  EXPECT_TRUE(report.ok());
  EXPECT_GT(problem.splittings, 0);
  EXPECT_GT(report.jacobian_evaluations, 0);
  EXPECT_LT(problem.residual_norm(x), 1e-14);
}

TEST(FixedPoint, AutomaticKeepsItOnlyWhereItIsQuick) {
  Ring near(6, 1e-5), far(6, 0.05);
  for (Ring* problem : {&near, &far}) {
    const auto solver = kinsol({.iteration = Iteration::automatic})(*problem);
    Vector x = Vector::Zero(6);
    for (int k = 0; k < 30; ++k) {
      problem->turn(0.2 * k);
      EXPECT_TRUE(solver->solve(x).ok());
      EXPECT_LT(problem->residual_norm(x), 2e-14);
    }
  }
  EXPECT_EQ(near.jacobians, 0);
  EXPECT_GT(far.jacobians, 15);
}

TEST(Names, AreReadAndUnknownOnesRefusedWithTheAllowedOnes) {
  EXPECT_EQ(jacobian_policy("per-step"), JacobianPolicy::per_step);
  EXPECT_STREQ(name(JacobianPolicy::kept), "kept");
  EXPECT_EQ(iteration("fixed-point"), Iteration::fixed_point);
  try {
    (void)jacobian_policy("sometimes");
    FAIL() << "taken";
  } catch (const Misuse& misuse) {
    const std::string text = misuse.what();
    for (const char* part : {"'sometimes'", "automatic", "fresh", "per-step", "kept"})
      EXPECT_NE(text.find(part), std::string::npos) << text;
  }
}

}  // namespace
}  // namespace diracstep
