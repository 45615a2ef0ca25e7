#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/row_scales.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <stdexcept>

#include "problems.hpp"

namespace diracstep {
namespace {

using testing::FunctionProblem;
using testing::linear;

constexpr double epsilon = 2.2e-16;

/// Solves one unknown from a guess.
struct Solved {
  SolveReport report;
  double x;
};
Solved solve(NonlinearProblem& problem, double guess, KinsolOptions options = {}) {
  Vector x = Vector::Constant(1, guess);
  const SolveReport report = kinsol(options)(problem)->solve(x);
  return {report, x[0]};
}

TEST(Kinsol, LinearSystemWithAFarSolutionTakesOneNewtonStep) {
  const Eigen::MatrixXd m{{2.0, 1.0}, {-1.0, 3.0}};
  const Vector solution{{1e6, -4.5e6}};
  for (const double guess : {0.0, 1.0, 1e-14}) {  // KINSOL's own limit of a step is 1000 times the guess
    FunctionProblem problem = linear(m, m * solution, {1e7, 1e7});
    Vector x = Vector::Constant(2, guess);
    const SolveReport report = kinsol()(problem)->solve(x);
    EXPECT_TRUE(report.ok()) << guess << ": " << describe(report.status);
    EXPECT_EQ(report.iterations, 1) << guess;
    EXPECT_LT((x - solution).lpNorm<Eigen::Infinity>(), 1e-8) << guess;
  }
}

TEST(Kinsol, StartAtTheSolutionTakesNoIteration) {
  FunctionProblem problem([](double x) { return x * x - 4.0; }, [](double x) { return 2.0 * x; });
  const Solved solved = solve(problem, 2.0);
  EXPECT_TRUE(solved.report.ok());
  EXPECT_EQ(solved.report.iterations, 0);
  EXPECT_EQ(solved.report.residual_evaluations, 1);
  EXPECT_EQ(solved.report.jacobian_evaluations, 0);
  EXPECT_EQ(solved.x, 2.0);
}

TEST(Kinsol, CountsAreThoseOfTheProblem) {
  int residuals = 0, jacobians = 0;
  FunctionProblem problem(
      SparsityPattern::dense(1, 1), {{"row", 1}},
      [&](ConstVectorRef x, VectorRef f) {
        ++residuals;
        f[0] = std::exp(x[0]) - 3.0;
      },
      [&](ConstVectorRef x, VectorRef values) {
        ++jacobians;
        values[0] = std::exp(x[0]);
      });
  const auto solver = kinsol()(problem);
  for (int k = 0; k < 2; ++k) {
    residuals = jacobians = 0;
    Vector x = Vector::Constant(1, 1.0);
    const SolveReport report = solver->solve(x);
    EXPECT_NEAR(x[0], std::log(3.0), 2.0 * epsilon);
    EXPECT_EQ(report.residual_evaluations, residuals);
    EXPECT_EQ(report.jacobian_evaluations, jacobians);
    EXPECT_EQ(report.iterations, jacobians) << "every iteration takes a fresh Jacobian";
    EXPECT_LE(residuals, jacobians + 1);
    EXPECT_LE(report.iterations, 5);
  }
}

TEST(Kinsol, ResidualThatStaysAtItsRoundOffIsAccepted) {
  // The terms are of size 1e3, so the residual cannot fall to 1e-15.
  FunctionProblem problem([](double x) { return x * x - 1000.1; }, [](double x) { return 2.0 * x; });
  const Solved solved = solve(problem, 30.0);
  EXPECT_TRUE(solved.report.ok());
  EXPECT_GT(solved.report.residual_norms[0], 1e-15) << "the tolerance was reached, so nothing is tested";
  EXPECT_NEAR(solved.x, std::sqrt(1000.1), 2e-14);
  EXPECT_LE(solved.report.iterations, 6);
}

TEST(Kinsol, ResidualThatStaysAboveTheAcceptedSizeIsAFailure) {
  FunctionProblem problem([](double x) { return x * x - 1000.1; }, [](double x) { return 2.0 * x; }, 1e-6);
  const Solved solved = solve(problem, 30.0);
  EXPECT_EQ(solved.report.status, SolveStatus::no_convergence);
  EXPECT_GT(solved.report.residual_norms[0], 1e-17);
}

TEST(Kinsol, SolutionFarFromTheOriginIsFoundToRoundOff) {
  // Steps are small beside the unknown long before they are small beside the distance over which F bends.
  FunctionProblem problem([](double x) { return (x - 1e6) + (x - 1e6) * (x - 1e6) - 0.02; },
                          [](double x) { return 1.0 + 2.0 * (x - 1e6); }, 1e6);
  const Solved solved = solve(problem, 1e6);
  EXPECT_TRUE(solved.report.ok());
  EXPECT_NEAR(solved.x - 1e6, std::sqrt(0.27) - 0.5, 2.0 * 1e6 * epsilon);
}

TEST(Kinsol, UnknownsOfVeryDifferentSizeAreBothFound) {
  // u and w of size 1, x = (1e-8 u, 1e8 w): u² + w = 3, w³ − u = 7, so u = 1, w = 2.
  FunctionProblem problem(
      SparsityPattern::dense(2, 2), {{"first", 1, 3.0}, {"second", 1, 8e6}},
      [](ConstVectorRef x, VectorRef f) {
        const double u = 1e8 * x[0], w = 1e-8 * x[1];
        f[0] = u * u + w - 3.0;
        f[1] = 1e6 * (w * w * w - u - 7.0);
      },
      [](ConstVectorRef x, VectorRef values) {
        const double u = 1e8 * x[0], w = 1e-8 * x[1];
        values << 2.0 * u * 1e8, -1e6 * 1e8, 1e-8, 1e6 * 3.0 * w * w * 1e-8;
      });
  for (const double start : {0.6, 1.5, 2.0}) {
    Vector x{{start * 1e-8, 2.0 * start * 1e8}};
    const SolveReport report = kinsol()(problem)->solve(x);
    EXPECT_TRUE(report.ok()) << describe(report.status) << " from " << start;
    EXPECT_NEAR(x[0] * 1e8, 1.0, 4.0 * epsilon) << start;
    EXPECT_NEAR(x[1] * 1e-8, 2.0, 4.0 * epsilon) << start;
  }
}

/// v − μ = −0.2 and v = 0, as of a body at rest on a floor: a guess of v that is next to zero is no unit of
/// μ.
TEST(Kinsol, AGuessNextToZeroIsNoUnit) {
  FunctionProblem problem(
      SparsityPattern::dense(2, 2), {{"momentum", 1, 0.2}, {"velocity", 1, 1e-100}},
      [](ConstVectorRef x, VectorRef f) { f << x[0] - x[1] + 0.2, x[0]; },
      [](ConstVectorRef, VectorRef values) { values << 1.0, 1.0, -1.0, 0.0; });
  for (const double guess : {1e-40, 1e-77, -3e-107, 1e-300}) {
    Vector x{{guess, 0.0}};
    const SolveReport report = kinsol()(problem)->solve(x);
    EXPECT_TRUE(report.ok()) << describe(report.status) << " from " << guess;
    EXPECT_NEAR(x[1], 0.2, epsilon) << guess;
  }
}

TEST(Kinsol, SingularJacobianIsReported) {
  const Eigen::MatrixXd singular{{1.0, 2.0}, {2.0, 4.0}}, zero = Eigen::MatrixXd::Zero(2, 2);
  for (const Eigen::MatrixXd& m : {singular, zero}) {
    FunctionProblem problem = linear(m, Vector{{1.0, 1.0}}, {1.0, 1.0});
    Vector x = Vector::Zero(2);
    const SolveReport report = kinsol()(problem)->solve(x);
    EXPECT_EQ(report.status, SolveStatus::singular_jacobian);
    EXPECT_EQ(report.residual_norms[0], 1.0);
  }
}

TEST(Kinsol, RegularJacobianWithSmallRowsOrColumnsIsNotSingular) {
  const Eigen::MatrixXd m{{1.0, 2.0}, {3.0, 4.0}};
  const Vector solution{{2.0, -1.0}};
  for (const double s : {1e-13, 1e-9, 1e9, 1e13}) {
    const Eigen::DiagonalMatrix<double, 2> scale(s, 1.0);
    const Eigen::MatrixXd rows = scale * m, columns = m * scale.inverse();
    FunctionProblem small_row = linear(rows, rows * solution, {10.0 * s, 10.0});
    FunctionProblem small_column = linear(columns, m * solution, {10.0, 10.0});
    Vector x = Vector::Zero(2), y = x;
    EXPECT_TRUE(kinsol()(small_row)->solve(x).ok()) << s;
    EXPECT_TRUE(kinsol()(small_column)->solve(y).ok()) << s;
    EXPECT_LT((x - solution).lpNorm<Eigen::Infinity>(), 1e-14) << s;
    EXPECT_LT((scale.inverse() * y - solution).lpNorm<Eigen::Infinity>(), 1e-14) << s;
  }
}

TEST(Kinsol, ResidualThatIsNotFiniteAtTheStartIsReported) {
  FunctionProblem problem([](double x) { return std::log(x); }, [](double x) { return 1.0 / x; });
  for (const double guess : {-1.0, std::nan(""), 0.0}) {
    const Solved solved = solve(problem, guess);
    EXPECT_EQ(solved.report.status, SolveStatus::not_finite) << guess;
    EXPECT_TRUE(std::isnan(solved.report.residual_norms[0])) << guess;
  }
}

TEST(Kinsol, ADiodeThatBlocksAtTheGuessIsMadeToConduct) {
  static constexpr double saturation = 1e-14, thermal = 0.02585, leak = 1e-12, current = 0.6;
  FunctionProblem problem([](double u) { return saturation * std::expm1(u / thermal) + leak * u - current; },
                          [](double u) { return saturation / thermal * std::exp(u / thermal) + leak; });
  for (const double guess : {-12.0, -1.0, -300.0}) {  // the first Newton step is to 6e11
    const Solved solved = solve(problem, guess);
    EXPECT_TRUE(solved.report.ok()) << guess << ": " << describe(solved.report.status);
    EXPECT_NEAR(solved.x, thermal * std::log1p(current / saturation), 1e-9) << guess;
  }
}

TEST(Kinsol, JacobianThatIsNotFiniteIsReported) {
  FunctionProblem problem([](double x) { return std::cbrt(x) - 1.0; },
                          [](double x) { return 1.0 / (x * x); });
  EXPECT_EQ(solve(problem, 0.0).report.status, SolveStatus::not_finite);
}

TEST(Kinsol, ShorterStepsLeadBackIntoTheDomain) {
  // The full Newton step from 10 goes to −9, where the logarithm is not defined.
  FunctionProblem problem([](double x) { return std::log(x) - 0.4; }, [](double x) { return 1.0 / x; });
  const Solved solved = solve(problem, 10.0);
  EXPECT_TRUE(solved.report.ok()) << describe(solved.report.status);
  EXPECT_NEAR(solved.x, std::exp(0.4), 4.0 * epsilon);
}

TEST(Kinsol, NoRootIsReportedWithTheResidualThatIsLeft) {
  FunctionProblem problem([](double x) { return x * x + 1.0; }, [](double x) { return 2.0 * x; });
  const Solved solved = solve(problem, 0.7);
  EXPECT_EQ(solved.report.status, SolveStatus::no_convergence);
  EXPECT_GE(solved.report.residual_norms[0], 1.0);
  EXPECT_NEAR(solved.report.residual_norms[0], solved.x * solved.x + 1.0, 1e-6)
      << "not that of the last iterate";
}

TEST(Kinsol, FailingNewtonIsRepeatedWithALineSearch) {
  FunctionProblem problem([](double x) { return std::atan(x); },
                          [](double x) { return 1.0 / (1.0 + x * x); });
  const Solved solved = solve(problem, 3.0);
  EXPECT_TRUE(solved.report.ok()) << describe(solved.report.status);
  EXPECT_NEAR(solved.x, 0.0, 1e-15);
  EXPECT_GT(solved.report.residual_evaluations, solved.report.iterations + 2) << "no shorter step was tried";
}

TEST(Kinsol, NormsOfBlocksAreUnscaledAndInOrder) {
  const Eigen::MatrixXd m = Eigen::MatrixXd::Zero(3, 3);
  FunctionProblem problem(
      SparsityPattern::dense(3, 3), {{"one", 1, 100.0}, {"two", 2, 0.01}},
      [](ConstVectorRef, VectorRef f) { f << -3.0, 0.5, -0.25; },
      [&](ConstVectorRef, VectorRef values) { values = m.reshaped(); });
  Vector x = Vector::Zero(3);
  const SolveReport report = kinsol()(problem)->solve(x);
  EXPECT_EQ(report.residual_norms[0], 3.0);
  EXPECT_EQ(report.residual_norms[1], 0.5);
}

TEST(Kinsol, ExceptionsOfTheProblemPassThroughAndLeaveTheSolverUsable) {
  struct Mine : std::runtime_error {
    using std::runtime_error::runtime_error;
  };
  int residuals_left = -1, jacobians_left = -1;
  FunctionProblem problem(
      SparsityPattern::dense(1, 1), {{"row", 1}},
      [&](ConstVectorRef x, VectorRef f) {
        if (residuals_left-- == 0) throw Mine("residual");
        f[0] = x[0] * x[0] - 4.0;
      },
      [&](ConstVectorRef x, VectorRef values) {
        if (jacobians_left-- == 0) throw Mine("jacobian");
        values[0] = 2.0 * x[0];
      });
  const auto solver = kinsol()(problem);
  const auto expect_thrown = [&](const char* message) {
    Vector x = Vector::Constant(1, 3.0);
    try {
      (void)solver->solve(x);
      ADD_FAILURE() << "nothing was thrown";
    } catch (const Mine& mine) {
      EXPECT_STREQ(mine.what(), message);
    }
    residuals_left = jacobians_left = -1;
    x[0] = 3.0;
    EXPECT_TRUE(solver->solve(x).ok());
    EXPECT_NEAR(x[0], 2.0, 2.0 * epsilon);
  };
  residuals_left = 0;
  expect_thrown("residual");
  residuals_left = 2;
  expect_thrown("residual");
  jacobians_left = 0;
  expect_thrown("jacobian");
  jacobians_left = 1;
  expect_thrown("jacobian");
}

/// 1e20 (x − 1) = 0 and, beside it in the same block, y² = square.
class HeavyAndLight final : public NonlinearProblem {
 public:
  explicit HeavyAndLight(double square) : square_(square) {}

  int size() const override { return 2; }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }
  void residual(ConstVectorRef x, VectorRef f) override {
    f[0] = mass * (x[0] - 1.0);
    f[1] = x[1] * x[1] - square_;
    last_ = x;
  }
  void jacobian(ConstVectorRef x, VectorRef values) override { values << mass, 0.0, 0.0, 2.0 * x[1]; }
  const double* scales_of_unsolved_rows(ConstVectorRef f, double level) override {
    scales_.set(0, Vector{{mass, std::abs(square_) + last_[1] * last_[1]}}, Vector::Zero(2), mass);
    return scales_.unsolved(f, level);
  }

 private:
  static constexpr double mass = 1e20;
  double square_;
  SparsityPattern pattern_ = SparsityPattern::dense(2, 2);
  std::array<ResidualBlock, 1> blocks_{{{"row", 2, mass}}};
  RowScales scales_{2};
  Vector last_;
};

TEST(Kinsol, ALightRowIsSolvedBesideAHeavyOneThatIsSolvedAlready) {
  HeavyAndLight problem(2.0);
  Vector x{{1.0, 1.5}};
  const SolveReport report = kinsol()(problem)->solve(x);
  EXPECT_TRUE(report.ok());
  EXPECT_EQ(x[0], 1.0);
  EXPECT_NEAR(x[1], std::sqrt(2.0), 4.0 * epsilon);
  HeavyAndLight impossible(-2.0);
  EXPECT_FALSE(kinsol()(impossible)->solve(x).ok());
}

}  // namespace
}  // namespace diracstep
