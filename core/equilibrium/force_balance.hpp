#pragma once

#include <Eigen/SparseCore>
#include <diracstep/core/equilibrium/equilibrium.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/scene.hpp>

namespace diracstep {

using SparseMatrix = Eigen::SparseMatrix<double>;

struct SortedRows;  // of the source

/// The equations of motion without acceleration, and their derivatives: what equilibria and linear equations
/// about them are made of.  On a group derivatives are left-trivialised, at rest alone, where C has −ad*_v
/// ∂L/∂v as well.  Third derivatives of L are left out; they vanish at rest and along motions that nothing
/// depends on.
class ForceBalance {
 public:
  /// The scene has a Lagrangian and outlives this.
  explicit ForceBalance(const Scene& scene);

  /// Takes all that does not depend on λ.
  void evaluate(double t, const Vector& q, const Vector& v);
  /// Takes `stiffness` and `sizes`, which do.
  void set_multipliers(const Vector& lambda);

  Vector forces;  ///< (∂²L/∂v∂q) v + ∂²L/∂v∂t − ∂L/∂q − f, which is to be Aᵀλ
  Vector sizes;   ///< of its terms, and of what round-off in q makes of them
  Vector position, velocity;              ///< φ of the holonomic rows; A v + b of all
  SparseMatrix mass, damping, stiffness;  ///< M, C, K of linearise()
  SparseMatrix one_forms;                 ///< A, holonomic rows first
  SparseMatrix row_derivative;            ///< ∂(A v + b)/∂q
  /// How many rows are on positions: holonomic ones, and in R^n nonholonomic ones with constant A, which
  /// keep A q as it is at the scene's start.
  int on_positions = 0;

  /// The blocks in the order of the rows here.
  const ConstraintBlocks& blocks() const { return blocks_; }
  /// Sizes of coordinates for what round-off makes of them; on a group the largest number for all.
  Vector position_sizes(const Vector& q) const;
  /// Values of rows in the order of the scene's rows, of those in the order here, and back.
  Vector in_order_of_scene(const Vector& here) const;
  Vector in_order_here(const Vector& of_scene) const;

 private:
  void evaluate_rows();
  ForceBalance(const Scene& scene, const SortedRows& rows);

  const Scene& scene_;
  ConstraintBlocks blocks_;
  std::vector<Eigen::Index> places_;  ///< for each row of the scene its place here
  ConstraintsAtPoint rows_;
  double t_ = 0.0;
  Vector q_, v_;
  SparseMatrix free_stiffness_;  ///< without the rows
  Vector free_sizes_;
};

/// The scene with a Lagrangian and another start, completed.
std::shared_ptr<const Scene> with_start(const Scene& scene, const Start& start);

/// That with its hidden rows below its own (hidden_rows.hpp).  Throws Misuse where it is too large for full
/// matrices.
std::shared_ptr<const Scene> with_start_and_hidden_rows(const Scene& scene, const Start& start);

/// The largest size of an entry, 0 where there is none.
double largest_entry(const SparseMatrix& matrix);

/// |to − from| beside |from|, in the Frobenius norm; |to| where `from` is zero.
double relative_change(const SparseMatrix& from, const SparseMatrix& to);

/// The multiplier of least norm with Aᵀλ ≈ forces in least squares.
Vector least_multipliers(const Columns& one_forms, const Vector& forces);

/// The matrix P, n×m, with that multiplier as Pᵀ forces.
Columns least_inverse(const Columns& one_forms);

/// Whether a block of rows fixes positions: see ForceBalance::on_positions.
inline bool is_on_positions(const ConstraintRows& block) { return block.holonomic() || block.constant(); }

/// An orthonormal basis of the kernel, the identity where the matrix has no rows.  A row of it counts as
/// dependent below 1e-10 of its size.
Columns null_space(const Columns& matrix);

}  // namespace diracstep
