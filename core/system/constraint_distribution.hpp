#pragma once

#include <diracstep/core/system/constraint_rows.hpp>
#include <vector>

namespace diracstep {

/// Δ_Q(q) = ker A(q), affine where b ≠ 0: the rows of all blocks, one below the other, on one m×n pattern.
/// Keeps scratch space, so each owner makes its own.
class ConstraintDistribution {
 public:
  ConstraintDistribution(const ConstraintBlocks& blocks, int dimension);

  int rows() const { return pattern_.rows(); }
  const ConstraintBlocks& blocks() const { return blocks_; }
  const SparsityPattern& pattern() const { return pattern_; }

  /// A(t,q) on pattern(), and b(t,q).
  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b);
  /// ∂(A(t,q) w + s b(t,q))/∂q on pattern().
  void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d);
  /// ∂(A(t,q) v + b(t,q))/∂t.
  void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d);

 private:
  template <class Evaluate>
  void for_each_block(VectorRef& values, Evaluate evaluate);

  ConstraintBlocks blocks_;
  SparsityPattern pattern_;
  BlockPattern layout_;
  std::vector<Vector> block_values_;
};

/// A(t,q) and b(t,q) kept at one point, and products with them.
class ConstraintsAtPoint {
 public:
  ConstraintsAtPoint(const ConstraintBlocks& blocks, int dimension);

  void evaluate(double t, ConstVectorRef q) { distribution_.coefficients(t, q, a_, b_); }
  int rows() const { return distribution_.rows(); }
  ConstraintDistribution& distribution() { return distribution_; }
  const SparsityPattern& pattern() const { return distribution_.pattern(); }
  const Vector& coefficients() const { return a_; }
  const Vector& offsets() const { return b_; }  ///< b

  /// out += factor · Aᵀ λ, an impulse or force in the annihilator Δ°_Q.
  void add_annihilator(ConstVectorRef lambda, VectorRef out, double factor = 1.0) const {
    pattern().transposed_multiply_add(a_.data(), lambda.data(), out.data(), factor);
  }
  /// out = A v + b.
  void velocity_residual(ConstVectorRef v, VectorRef out) const {
    out = b_;
    pattern().multiply_add(a_.data(), v.data(), out.data());
  }

 private:
  ConstraintDistribution distribution_;
  Vector a_, b_;
};

}  // namespace diracstep
