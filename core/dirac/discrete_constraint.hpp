#pragma once

#include <diracstep/core/dirac/discrete_rows.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>

namespace diracstep {

/// The discrete constraint distribution Δ^d_Q ⊂ Q×Q as c(q0,q1) = 0, m rows in units of position:
///
///   nonholonomic rows   Σ w_i [A(t_i, q_i)(q1−q0) + h b(t_i, q_i)],   q_i = (1−c_i) q0 + c_i q1
///   holonomic rows      φ(t1, q1), so that nothing drifts
///
/// with the nodes of the rule (left, right: order 1; midpoint, trapezoidal: order 2), or nonholonomic rows of
/// one's own.  It induces Δ_Q back (Leok and Ohsawa (4.18)–(4.19)), and contains the diagonal (4.17)
/// for linear nonholonomic rows; φ(t1, q1) = 0 holds on the diagonal only over N = {φ = 0}, affine rows only
/// where their drift vanishes.
class DiscreteConstraint {
 public:
  DiscreteConstraint(const ConstraintBlocks& blocks, int dimension, const ConstraintRule& rule);

  int rows() const { return pattern_.rows(); }

  /// Of ∂c/∂q1.
  const SparsityPattern& pattern() const { return pattern_; }

  /// out = c(q0,q1); `increment` is q1 − q0, given apart where it is known to more digits than the difference
  /// has.
  void residual(Interval step, ConstVectorRef q0, ConstVectorRef q1, ConstVectorRef increment, VectorRef out);
  void residual(Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef out);

  /// d = ∂c/∂q1 on pattern().
  void end_derivative(Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef d);

 private:
  struct Block {
    std::shared_ptr<const ConstraintRows> rows;
    int first;  ///< row
    Vector coefficients, offset, node_derivative, derivative;
  };
  void residual(Block& block, Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef c);
  void end_derivative(Block& block, Interval step, ConstVectorRef q0, ConstVectorRef q1);

  /// The rows of one's own and where they stand among all.
  struct Own {
    std::shared_ptr<const DiscreteRows> rows;
    std::vector<int> places;
    Vector values, derivative;
  };
  void plan_own(std::vector<int> places, int dimension);

  StepRule rule_;
  std::vector<Block> blocks_;  ///< without the nonholonomic ones where there are own rows
  Own own_;
  SparsityPattern pattern_;
  BlockPattern layout_;
  Vector q_, increment_;
};

}  // namespace diracstep
