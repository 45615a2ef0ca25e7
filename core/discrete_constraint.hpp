#pragma once

#include <diracstep/core/constraint_rows.hpp>
#include <diracstep/core/generating_function.hpp>
#include <diracstep/core/step_nodes.hpp>

namespace diracstep {

/// The discrete constraint distribution Δ^d_Q ⊂ Q×Q as c(q0,q1) = 0, m rows in units of position:
///
///   nonholonomic rows   Σ w_i [A(t_i, q_i)(q1−q0) + h b(t_i, q_i)],   q_i = (1−c_i) q0 + c_i q1
///   holonomic rows      φ(t1, q1), so that nothing drifts
///
/// with the nodes of `rule` (left, right: order 1; midpoint, trapezoidal: order 2).  It contains the diagonal and
/// induces Δ_Q back (Leok and Ohsawa (4.17)–(4.19)).
class DiscreteConstraint {
 public:
  DiscreteConstraint(const ConstraintBlocks& blocks, StepRule rule);

  StepRule rule() const { return rule_; }
  int rows() const { return rows_; }
  const ConstraintBlocks& blocks() const { return blocks_; }

  /// out = c(q0,q1).
  void residual(Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef out);

  /// Evaluates ∂c/∂q1; afterwards `end_derivative(k)` holds it for block k, on that block's pattern.
  void differentiate(Interval step, ConstVectorRef q0, ConstVectorRef q1);
  const Vector& end_derivative(std::size_t block) const { return work_[block].derivative; }

 private:
  struct Work {
    Vector coefficients, offset, node_derivative, derivative, rows;
  };

  ConstraintBlocks blocks_;
  StepRule rule_;
  int rows_;
  std::vector<Work> work_;
  Vector q_, increment_;
};

}  // namespace diracstep
