#include <dlfcn.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "allocations.hpp"
#include "differences.hpp"
#include "problems.hpp"

namespace {

/// Calls of KLU, counted by taking the place of its functions.
struct KluCalls {
  int analyze = 0, factor = 0, refactor = 0;
};
KluCalls klu_calls;

template <class Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

void* klu_analyze(int n, int* starts, int* rows, void* common) {
  ++klu_calls.analyze;
  return next<decltype(&klu_analyze)>("klu_analyze")(n, starts, rows, common);
}
void* klu_factor(int* starts, int* rows, double* values, void* symbolic, void* common) {
  ++klu_calls.factor;
  return next<decltype(&klu_factor)>("klu_factor")(starts, rows, values, symbolic, common);
}
int klu_refactor(int* starts, int* rows, double* values, void* symbolic, void* numeric, void* common) {
  ++klu_calls.refactor;
  return next<decltype(&klu_refactor)>("klu_refactor")(starts, rows, values, symbolic, numeric, common);
}
}

namespace diracstep {
namespace {

using testing::FunctionProblem;
using testing::linear;

/// A chain of 12 unknowns with 4 rows of constraints: M u + u³/30 − Aᵀλ, A u, two rows scaled by 1e6 and two
/// by 1e-6.
class Chain {
 public:
  static constexpr int n = 12, m = 4;

  Chain() : matrix_(Eigen::MatrixXd::Zero(n + m, n + m)), right_side_(Vector::LinSpaced(n + m, 0.5, 2.0)) {
    for (int i = 0; i < n; ++i) {
      matrix_(i, i) = 2.0 + 0.1 * i;
      if (i > 0) matrix_(i, i - 1) = matrix_(i - 1, i) = -1.0;
    }
    for (int r = 0; r < m; ++r) {
      for (int k = 3 * r; k < 3 * r + 3; ++k) {
        matrix_(n + r, k) = row_scale(r) * (1.0 + 0.7 * k - 2.0 * r);
        matrix_(k, n + r) = -matrix_(n + r, k);
      }
      right_side_[n + r] *= row_scale(r);
    }
  }

  static double row_scale(int r) { return r < 2 ? 1e6 : 1e-6; }

  FunctionProblem problem(bool dense) const {
    SparsityPattern pattern = SparsityPattern::dense(n + m, n + m);
    auto entries = pattern.entries();
    if (!dense) {
      std::erase_if(entries, [this](auto entry) { return matrix_(entry.first, entry.second) == 0.0; });
      pattern = SparsityPattern(n + m, n + m, entries);
    }
    const auto residual = [this](ConstVectorRef x, VectorRef f) {
      f = -right_side_;
      f.noalias() += matrix_ * x;
      f.head(n).array() += x.head(n).array().cube() / 30.0;
    };
    const auto jacobian = [this, entries](ConstVectorRef x, VectorRef values) {
      Eigen::Index k = 0;
      for (const auto& [i, j] : entries)
        values[k++] = matrix_(i, j) + (i == j && i < n ? 0.1 * x[i] * x[i] : 0.0);
    };
    const std::vector<ResidualBlock> blocks{{"momentum", n, 10.0},
                                            {"large rows", 2, 10.0 * row_scale(0)},
                                            {"small rows", 2, 10.0 * row_scale(2)}};
    return {pattern, blocks, residual, jacobian};
  }

  /// The unknowns with multipliers in the units of unscaled rows.
  static Vector comparable(Vector x) {
    for (int r = 0; r < m; ++r) x[n + r] *= row_scale(r);
    return x;
  }

 private:
  Eigen::MatrixXd matrix_;
  Vector right_side_;
};

bool has_klu(FunctionProblem& sparse) {
  return kinsol()(sparse)->description().find("KLU") != std::string::npos;
}

/// With whatever this build solves sparse systems: full matrices and others are at work without KLU.
TEST(KinsolSparse, BandsOfAnySizeAreSolved) {
  for (const int n : {4, 30, 250}) {
    Eigen::MatrixXd m = Eigen::MatrixXd::Zero(n, n);
    m.diagonal().setConstant(2.0);
    m.diagonal(1).setConstant(1.0);
    m.diagonal(-1).setConstant(-0.5);
    const Vector solution = Vector::LinSpaced(n, -1.0, 1.0);
    std::vector<std::pair<int, int>> entries;
    for (int j = 0; j < n; ++j)
      for (int i = std::max(0, j - 1); i < std::min(n, j + 2); ++i) entries.emplace_back(i, j);
    FunctionProblem problem(
        SparsityPattern(n, n, entries), {{"rows", n, 4.0}},
        [&](ConstVectorRef x, VectorRef f) { f = m * (x - solution); },
        [&](ConstVectorRef, VectorRef values) {
          Eigen::Index k = 0;
          for (const auto& [i, j] : entries) values[k++] = m(i, j);
        });
    const auto solver = kinsol()(problem);
    for (int again = 0; again < 2; ++again) {
      Vector x = Vector::Zero(n);
      EXPECT_TRUE(solver->solve(x).ok()) << n;
      EXPECT_LT((x - solution).lpNorm<Eigen::Infinity>(), 1e-14) << n;
      m *= -0.7;
    }
  }
}

class KinsolKlu : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!has_klu(sparse_)) GTEST_SKIP() << "built without KLU";
    klu_calls = {};
  }

  Chain chain_;
  FunctionProblem sparse_ = chain_.problem(false);
};

TEST_F(KinsolKlu, AgreesWithFullMatricesOnABadlyScaledSaddlePoint) {
  FunctionProblem full = chain_.problem(true);
  const auto dense_solver = kinsol()(full), sparse_solver = kinsol()(sparse_);
  EXPECT_NE(dense_solver->description().find("dense"), std::string::npos);
  EXPECT_NE(sparse_solver->description().find("KLU"), std::string::npos);
  Vector a = Vector::Zero(sparse_.size()), b = a, f = a;
  EXPECT_LT(testing::jacobian_error(sparse_, a), 1e-3);  // of entries up to 3e6
  const SolveReport dense = dense_solver->solve(a), sparse = sparse_solver->solve(b);
  EXPECT_TRUE(dense.ok()) << describe(dense.status);
  EXPECT_TRUE(sparse.ok()) << describe(sparse.status);
  EXPECT_LT((Chain::comparable(a) - Chain::comparable(b)).lpNorm<Eigen::Infinity>(), 1e-13);
  sparse_.residual(b, f);
  EXPECT_LT(f.head(Chain::n).lpNorm<Eigen::Infinity>(), 2e-14);
}

TEST_F(KinsolKlu, AnalysesOnceAndKeepsItsPivots) {
  const auto solver = kinsol({.jacobian = JacobianPolicy::fresh})(sparse_);
  long iterations = 0;
  for (int k = 0; k < 50; ++k) {
    Vector x = Vector::Constant(sparse_.size(), 0.01 * k);
    const SolveReport report = solver->solve(x);
    EXPECT_TRUE(report.ok());
    iterations += report.iterations;
  }
  EXPECT_GT(iterations, 100);
  EXPECT_EQ(klu_calls.analyze, 1);
  EXPECT_EQ(klu_calls.factor, 1);
  EXPECT_EQ(klu_calls.refactor, iterations) << "the first one only leaves out the scaling of the rows";
}

/// Six unknowns in a row, each tied to its neighbours by 1 and to itself by `diagonal`, which makes good
/// pivots where it is large and bad ones where it is small.
FunctionProblem row_of_six(const double& diagonal) {
  std::vector<std::pair<int, int>> entries;
  for (int i = 0; i < 6; ++i)
    for (int j = std::max(0, i - 1); j < std::min(6, i + 2); ++j) entries.emplace_back(i, j);
  const SparsityPattern pattern(6, 6, entries);
  const auto residual = [&diagonal](ConstVectorRef x, VectorRef f) {
    f = diagonal * x - Vector::LinSpaced(6, 1.0, 6.0);
    f.head(5) += x.tail(5);
    f.tail(5) += x.head(5);
  };
  const auto jacobian = [&diagonal, places = pattern.entries()](ConstVectorRef, VectorRef values) {
    Eigen::Index k = 0;
    for (const auto& [i, j] : places) values[k++] = i == j ? diagonal : 1.0;
  };
  return {pattern, {{"rows", 6, 10.0}}, residual, jacobian};
}

TEST_F(KinsolKlu, TakesNewPivotsWhereTheOldOnesFail) {
  for (const double small : {0.0, 1e-20, 1e-15, 1e-12, 1e-9, 1e-6}) {
    double diagonal = 100.0;
    FunctionProblem problem = row_of_six(diagonal);
    const auto solver = kinsol()(problem);
    Vector x = Vector::Zero(6), f(6);
    EXPECT_TRUE(solver->solve(x).ok());
    diagonal = small;
    const SolveReport report = solver->solve(x);
    EXPECT_TRUE(report.ok()) << small << ": " << describe(report.status);
    EXPECT_LE(report.iterations, 2) << small << ": the factors are inaccurate";
    problem.residual(x, f);
    EXPECT_LT(f.lpNorm<Eigen::Infinity>(), 2e-14) << small;
  }
}

TEST_F(KinsolKlu, RegularJacobianWithSmallRowsOrColumnsIsNotSingular) {
  for (const double small : {1e-18, 1e-30, 1e18})
    for (const bool column : {false, true}) {
      Eigen::MatrixXd m{
          {2.0, 1.0, 0.0, 0.0}, {1.0, 3.0, 1.0, 0.0}, {0.0, 1.0, 4.0, 1.0}, {0.0, 0.0, 1.0, 5.0}};
      if (column)
        m.col(2) *= small;
      else
        m.row(2) *= small;
      const std::vector<double> scales{1.0, 1.0, column ? 1.0 : small, 1.0};
      FunctionProblem problem = linear(m, m * Vector::Ones(4), scales, false);
      Vector x = Vector::Zero(4);
      const SolveReport report = kinsol()(problem)->solve(x);
      EXPECT_TRUE(report.ok()) << small << (column ? " column: " : " row: ") << describe(report.status);
    }
}

TEST_F(KinsolKlu, PivotsOfRoundOffAreSingular) {
  // The last row is the sum of the others but for round-off.
  const Eigen::MatrixXd m{
      {0.1, 0.3, 0.0, 0.7}, {0.0, 0.9, 0.7, 0.0}, {0.3, 0.0, 0.1, 0.2}, {0.4, 1.2, 0.8, 0.9}};
  FunctionProblem problem = linear(m, Vector::LinSpaced(4, 1.0, 7.0), {1.0, 1.0, 1.0, 1.0}, false);
  Vector x = Vector::Zero(4);
  EXPECT_EQ(kinsol()(problem)->solve(x).status, SolveStatus::singular_jacobian);
}

TEST_F(KinsolKlu, SingularJacobianIsReported) {
  const Eigen::MatrixXd m{{1.0, 2.0, 0.0}, {2.0, 4.0, 0.0}, {0.0, 0.0, 1.0}};
  FunctionProblem problem = linear(m, Vector::Ones(3), {1.0, 1.0, 1.0}, false);
  Vector x = Vector::Zero(3);
  EXPECT_EQ(kinsol()(problem)->solve(x).status, SolveStatus::singular_jacobian);
}

void expect_no_allocation_after_the_first_solve(NonlinearProblem& problem) {
  const auto solver = kinsol()(problem);
  Vector x = Vector::Constant(problem.size(), 0.1);
  EXPECT_TRUE(solver->solve(x).ok());
  long iterations = 0;
  const long before = testing::allocations;
  for (int k = 0; k < 20; ++k) {
    x.setConstant(0.02 * k);
    iterations += solver->solve(x).iterations;
  }
  EXPECT_EQ(testing::allocations - before, 0)
      << "in " << iterations << " iterations, size " << problem.size();
  EXPECT_GT(iterations, 20);
}

class KinsolAllocations : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!testing::counts_allocations) GTEST_SKIP() << "allocations cannot be counted here";
    const long before = testing::allocations;
    ::operator delete(::operator new(1));
    EXPECT_GT(testing::allocations, before) << "the count does not work";
  }
};

TEST_F(KinsolAllocations, SolvesWithFullMatricesAllocateNothingAfterTheFirst) {
  for (const int n : {1, 3, 12, 40, 80}) {
    FunctionProblem problem(
        SparsityPattern::dense(n, n), {{"rows", n, 10.0}},
        [](ConstVectorRef x, VectorRef f) {
          f = 3.0 * x.array() + x.array().cube() + 0.5 * x.reverse().array() - 1.0;
        },
        [n](ConstVectorRef x, VectorRef values) {
          values.setZero();
          for (int i = 0; i < n; ++i) {
            values[i + i * n] += 3.0 + 3.0 * x[i] * x[i];
            values[i + (n - 1 - i) * n] += 0.5;
          }
        });
    expect_no_allocation_after_the_first_solve(problem);
  }
}

TEST_F(KinsolAllocations, SolvesWithKluAllocateNothingAfterTheFirst) {
  const Chain chain;
  FunctionProblem problem = chain.problem(false);
  if (!has_klu(problem)) GTEST_SKIP() << "built without KLU";
  expect_no_allocation_after_the_first_solve(problem);
}

}  // namespace
}  // namespace diracstep
