#pragma once

#include <Eigen/SparseLU>
#include <diracstep/core/equilibrium/equilibrium.hpp>
#include <diracstep/core/equilibrium/force_balance.hpp>

namespace diracstep {

/// Factors of a matrix [ block  −Aᵀ; rows  0 ] as a sparse one.
class SaddleFactors {
 public:
  SaddleFactors(const SparseMatrix& block, const SparseMatrix& one_forms, const SparseMatrix& rows);

  /// Whether rows depend on each other, or the block leaves a direction open on them, to 1e-14 of rows and
  /// columns of like size.
  bool singular() const { return singular_; }
  Vector solve(const Vector& right) const;

 private:
  Eigen::SparseLU<SparseMatrix> factors_;  ///< of the matrix with rows and columns of like size
  Vector row_scales_, column_scales_;
  bool singular_ = false;
};

/// A direction along which nothing draws back on the rows, where such a matrix is singular: by inverse
/// iteration of the matrix with a small multiple of the identity in its block.  "x 1, y 0.5", the largest
/// entries first; empty where rows depend on each other.
std::string free_direction(const Scene& scene, const SparseMatrix& block, const SparseMatrix& one_forms,
                           const SparseMatrix& rows);

/// find_equilibrium() of a scene that is too large for full matrices: Newton's method for q and λ at once,
/// damped by the natural monotonicity test (Deuflhard, Newton Methods for Nonlinear Problems, 2004, 3.3).
/// Rows are on positions, or on velocities with constant coefficients; redundant ones are left out, and the
/// forces are the least ones of all.  The equilibrium is isolated; Equilibrium::failure tells where it is
/// not; `go_on` is asked before each iteration.  Throws Misuse for other rows on velocities, which leave more
/// positions than they allow velocities.
Equilibrium find_sparse_equilibrium(const Scene& scene, const std::function<bool()>& go_on = {});

/// The scene itself, or a copy without the rows that are redundant at its start, as with_rows_left_out().
std::shared_ptr<const Scene> with_independent_rows_there(const std::shared_ptr<const Scene>& scene);

}  // namespace diracstep
