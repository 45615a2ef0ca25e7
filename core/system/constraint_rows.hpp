#pragma once

#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/system/point_columns.hpp>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace diracstep {

/// m rows of a constraint on velocities,  A(t,q) v + b(t,q) = 0,  all nonholonomic or all holonomic.
///
/// The rows of A are the one-forms ω^a whose common kernel is Δ_Q(q); their span is the annihilator Δ°_Q(q).
/// Holonomic rows are the time derivative of φ(t,q) = 0, so A = ∂φ/∂q and b = ∂φ/∂t.
/// `pattern()` (m×n) holds A and every derivative ∂(A w + s b)/∂q; `curvature_pattern()` (n×n, symmetric)
/// holds ∂(Aᵀλ)/∂q.  Objects are immutable and may be used from several threads at once.
class ConstraintRows {
 public:
  ConstraintRows(bool holonomic, SparsityPattern pattern, SparsityPattern curvature_pattern,
                 std::vector<std::string> names);
  ConstraintRows(const ConstraintRows&) = delete;
  ConstraintRows& operator=(const ConstraintRows&) = delete;
  virtual ~ConstraintRows() = default;

  bool holonomic() const { return holonomic_; }
  int rows() const { return pattern_.rows(); }
  int dimension() const { return pattern_.columns(); }
  const SparsityPattern& pattern() const { return pattern_; }
  const SparsityPattern& curvature_pattern() const { return curvature_pattern_; }
  const std::vector<std::string>& names() const { return names_; }

  /// Where a row comes from that the author of the scene has not written, in words; empty for others.
  virtual std::string origin(int row) const;

  /// Whether A depends on neither t nor q, and b not on q; false where that is not known.
  virtual bool constant() const { return false; }

  /// Whether b = 0 everywhere and t does not enter, so that the forces of the rows do no work; false where
  /// that is not known.
  virtual bool workless() const { return false; }

  /// φ(t,q), m values.  Holonomic rows only; the default throws Misuse.
  virtual void position(double t, ConstVectorRef q, VectorRef phi) const;

  /// A(t,q) on pattern(), and b(t,q).
  virtual void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const = 0;

  /// ∂(A(t,q) w + s b(t,q))/∂q on pattern(), w and s held fixed.
  virtual void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) const = 0;

  /// ∂(A(t,q) v + b(t,q))/∂t, v held fixed.
  virtual void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) const = 0;

  /// ∂(A(t,q)ᵀ λ)/∂q on curvature_pattern(), λ held fixed.
  virtual void annihilator_derivative(double t, ConstVectorRef q, ConstVectorRef lambda,
                                      VectorRef d) const = 0;

  /// position(), coefficients(), derivative() along w = y with s = 1, and annihilator_derivative() with a
  /// column of multipliers for each point, at several points and into columns.  A step calls each once for
  /// all its nodes.
  virtual void positions(const PointColumns& at, double* phi) const;
  virtual void coefficients_at(const PointColumns& at, double* a, double* b) const;
  virtual void derivatives(const PointColumns& at, double* d) const;
  virtual void annihilator_derivatives(const PointColumns& at, const double* multipliers, double* d) const;

 private:
  bool holonomic_;
  SparsityPattern pattern_;
  SparsityPattern curvature_pattern_;
  std::vector<std::string> names_;
};

/// The constraints of a scene, block by block.
using ConstraintBlocks = std::vector<std::shared_ptr<const ConstraintRows>>;

/// Number of rows in all blocks.
int row_count(const ConstraintBlocks& blocks);

/// A row for messages: "row 'blade'", with its origin in brackets where it has one.  `row` counts through all
/// blocks.
std::string row_label(const ConstraintBlocks& blocks, int row);

/// Those blocks that are holonomic, or those that are not.
ConstraintBlocks only_holonomic(const ConstraintBlocks& blocks);
ConstraintBlocks only_nonholonomic(const ConstraintBlocks& blocks);

}  // namespace diracstep
