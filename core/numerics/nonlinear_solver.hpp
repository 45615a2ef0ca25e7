#pragma once

#include <array>
#include <diracstep/core/numerics/contraction.hpp>
#include <diracstep/core/numerics/snapshot.hpp>
#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <functional>
#include <memory>
#include <span>
#include <string>

namespace diracstep {

/// Consecutive rows of a residual that share a meaning and a unit.
struct ResidualBlock {
  const char* name;  ///< "momentum", "constraint", …
  int rows;
  double scale = 1.0;  ///< size of the terms that cancel in these rows at a solution; round-off is ε·scale
};

/// F(x) = 0, square, with an exact Jacobian on a fixed pattern: all that a solver sees of a step.
class NonlinearProblem {
 public:
  virtual ~NonlinearProblem() = default;
  virtual int size() const = 0;
  virtual const SparsityPattern& pattern() const = 0;
  /// The blocks in row order; their scales may change from one solve to the next.
  virtual std::span<const ResidualBlock> blocks() const = 0;
  virtual void residual(ConstVectorRef x, VectorRef f) = 0;
  virtual void jacobian(ConstVectorRef x, VectorRef values) = 0;

  /// Asked of a residual f, where it was last taken, that is small beside the scales of its blocks: whether
  /// each row is at most `level` times the size of its own terms (RowScales), which may be far smaller.  Null
  /// where that is so, and for problems whose rows are alike; else the scales of all rows, by which the
  /// solver goes on.  A few comparisons for each row, unless one is not small.
  virtual const double* scales_of_unsolved_rows(ConstVectorRef /*f*/, double /*level*/) { return nullptr; }

  /// Where the Jacobian is the same at every x and in every solve with the same value of some parameter, such
  /// as the step size: that value.  NaN where it is not.
  virtual double constant_jacobian_parameter() const;

  /// Whether there is a splitting: a matrix P near the Jacobian which costs little to solve with, so that
  /// x ← x − P⁻¹F(x) converges quickly.
  virtual bool has_splitting() const { return false; }
  /// f ← P⁻¹ f.  Called only where there is a splitting.
  virtual void solve_splitting(VectorRef /*f*/) {}
  /// x ← x − P⁻¹F(x) again and again (contraction.hpp), with the last correction in f.  Called only where
  /// there is a splitting; a problem that can do it without a call for each part of an iteration does it
  /// itself.
  virtual Contraction contract(VectorRef x, VectorRef f, const ContractionLimits& limits);
};

/// Maximum norm of each block of a residual into `norms`, and the largest entry in units of its block;
/// infinite where an entry is no number.
double norms_of_blocks(std::span<const ResidualBlock> blocks, const double* f, std::array<double, 4>& norms);

/// How a solve ended.
enum class SolveStatus {
  ok,
  no_convergence,     ///< iterations used up or the residual no longer falls
  singular_jacobian,  ///< the linear solver met a zero pivot
  not_finite,         ///< a residual or Jacobian was NaN or infinite
  other_branch,       ///< solved, but smaller steps do not lead to this solution (step_continuation.hpp)
  refused,            ///< not solved at all: the failure of the step says why
};

/// One line a person can read.
const char* describe(SolveStatus status);

/// What a solve did.  `residual_norms[i]` is the maximum norm of block i at the last point, unscaled.
struct [[nodiscard]] SolveReport {
  SolveStatus status = SolveStatus::ok;
  int iterations = 0;
  int residual_evaluations = 0;
  int jacobian_evaluations = 0;
  int line_searches = 0;  ///< attempts with a line search, after plain Newton failed
  std::array<double, 4> residual_norms{};

  bool ok() const { return status == SolveStatus::ok; }

  /// Adds the work of a further solve.
  void add_work(const SolveReport& further) {
    iterations += further.iterations;
    residual_evaluations += further.residual_evaluations;
    jacobian_evaluations += further.jacobian_evaluations;
    line_searches += further.line_searches;
  }
  /// Takes in a further solve, whose outcome is now that of both.
  void add(const SolveReport& further) {
    add_work(further);
    status = further.status;
    residual_norms = further.residual_norms;
  }
};

/// Solves F(x) = 0 from the guess in x.  On failure x is the last iterate.
/// An exception thrown by the problem's own functions passes through.
class NonlinearSolver {
 public:
  virtual ~NonlinearSolver() = default;
  virtual SolveReport solve(VectorRef x) = 0;
  /// Drops what it keeps between solves (pivots, old factors), so that a run repeats bit by bit.
  virtual void reset() {}
  /// Writes and reads what is kept between solves, so that those after `restore` repeat bit by bit.
  virtual void save(Snapshot& /*to*/) const {}
  virtual void restore(SnapshotReader& /*from*/) {}
  /// What does the work, for plans and reports: "KINSOL, dense".
  virtual std::string description() const = 0;
  /// How it goes about it, for plans: "Newton's method, fresh Jacobian in each iteration".
  virtual std::string strategy() const { return "Newton's method, exact Jacobian"; }
};

/// Makes the solver of one problem; the problem outlives it.
using SolverFactory = std::function<std::unique_ptr<NonlinearSolver>(NonlinearProblem&)>;

}  // namespace diracstep
