#pragma once

#include <diracstep/core/numerics/snapshot.hpp>
#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <memory>

namespace diracstep::detail {

/// Factors a matrix on a fixed pattern and solves with it.
class LinearSolver {
 public:
  virtual ~LinearSolver() = default;
  /// False where a pivot vanishes or is not finite.
  virtual bool factor(const double* values) = 0;
  /// Replaces b by the solution.
  virtual void solve(double* b) = 0;
  /// Drops the pivots of earlier factorisations.
  virtual void reset() {}
  /// Writes and reads what the next factorisation depends on; the factors themselves are made anew, see
  /// holds().
  virtual void save(Snapshot& /*to*/) const {}
  virtual void restore(SnapshotReader& /*from*/) {}
  /// Whether restore() has made the factors of this matrix already, in the way the saved ones were made.
  virtual bool holds(const double* /*values*/) const { return false; }
  virtual const char* name() const = 0;
};

/// For full matrices, column by column.
std::unique_ptr<LinearSolver> make_dense_lu(int size);
/// KLU; without it a general sparse LU, or a full one where that is quicker.  The pattern outlives the
/// solver.
std::unique_ptr<LinearSolver> make_sparse_lu(const SparsityPattern& pattern);
/// The dense one for full patterns, the sparse one for the others.
std::unique_ptr<LinearSolver> make_linear_solver(const SparsityPattern& pattern);

}  // namespace diracstep::detail
