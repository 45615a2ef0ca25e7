#pragma once

#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/dirac/step_rule.hpp>
#include <diracstep/core/system/constraint_rows.hpp>
#include <memory>
#include <utility>

namespace diracstep {

/// A discrete constraint distribution of one's own for the nonholonomic rows of a scene: m rows c(q0,q1) = 0
/// in units of position, in the order of those rows, in place of what a StepRule makes of their one-forms.
/// Objects are immutable and may be used from several threads at once.
class DiscreteRows {
 public:
  explicit DiscreteRows(SparsityPattern pattern) : pattern_(std::move(pattern)) {}
  DiscreteRows(const DiscreteRows&) = delete;
  DiscreteRows& operator=(const DiscreteRows&) = delete;
  virtual ~DiscreteRows() = default;

  int rows() const { return pattern_.rows(); }
  /// Of ∂c/∂q1, m×n.
  const SparsityPattern& pattern() const { return pattern_; }

  /// c(q0,q1), m values; may depend on the interval.
  virtual void residual(Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef c) const = 0;
  /// ∂c/∂q1 on pattern().
  virtual void end_derivative(Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef d) const = 0;

 private:
  SparsityPattern pattern_;
};

/// How Δ^d_Q comes from Δ_Q: a rule by name, or rows of one's own.
struct ConstraintRule {
  ConstraintRule(StepRule rule)
      : nodes(rule) {}  // NOLINT(google-explicit-constructor): one argument, either kind
  ConstraintRule(std::shared_ptr<const DiscreteRows> rows) : own(std::move(rows)) {}  // NOLINT
  template <class Rows>
  ConstraintRule(std::shared_ptr<Rows> rows) : own(std::move(rows)) {}  // NOLINT

  StepRule nodes = StepRule::midpoint;      ///< of the rows where they have none of their own, and of forces
  std::shared_ptr<const DiscreteRows> own;  ///< null where the rule is one by name

  std::string description() const { return own ? "own" : name(nodes); }
};

/// Throws Misuse unless the rows discretise the nonholonomic ones among `constraints` at (t, q), saying which
/// requirement fails and by how much.  An integrator asks at the start of each step, wherever the motion
/// goes:
///
///   (q,q) ∈ Δ^d_Q                   c = 0 on the diagonal for h = 0          Leok and Ohsawa (4.17)
///   ∂c/∂q1 at (q,q) spans Δ°_Q(q)   so that Δ^d_Q induces Δ_Q back           (4.18), (4.19)
///   c(q,q)/h → b                    the same for affine rows, h → 0
///   ∂c/∂q1                          agrees with differences near (q,q)
///
/// Tolerances are 1e-9 of the terms, and 1e-6 for differences.
void require_discretisation(const DiscreteRows& rows, const ConstraintBlocks& constraints, double t,
                            ConstVectorRef q);

}  // namespace diracstep
