#include <diracstep/core/discrete_constraint.hpp>

namespace diracstep {

DiscreteConstraint::DiscreteConstraint(const ConstraintBlocks& blocks, StepRule rule)
    : blocks_(blocks), rule_(rule), rows_(row_count(blocks)) {
  for (const auto& block : blocks_) {
    const int nonzeros = block->pattern().nonzeros();
    work_.push_back({Vector::Zero(nonzeros), Vector::Zero(block->rows()), Vector::Zero(nonzeros),
                     Vector::Zero(nonzeros), Vector::Zero(block->rows())});
    q_ = increment_ = Vector::Zero(block->dimension());
  }
}

void DiscreteConstraint::residual(Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef out) {
  if (rows_ == 0) return;
  increment_ = q1 - q0;
  int row = 0;
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    const ConstraintRows& block = *blocks_[k];
    Work& work = work_[k];
    auto c = out.segment(row, block.rows());
    row += block.rows();
    if (block.holonomic()) {
      block.position(step.start + step.size, q1, c);
      continue;
    }
    c.setZero();
    for (const StepNode& node : step_nodes(rule_)) {
      q_ = (1.0 - node.c) * q0 + node.c * q1;
      block.coefficients(step.start + node.c * step.size, q_, work.coefficients, work.offset);
      c += node.weight * step.size * work.offset;
      block.pattern().multiply_add(work.coefficients.data(), increment_.data(), c.data(), node.weight);
    }
  }
}

void DiscreteConstraint::differentiate(Interval step, ConstVectorRef q0, ConstVectorRef q1) {
  if (rows_ == 0) return;
  increment_ = q1 - q0;
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    const ConstraintRows& block = *blocks_[k];
    Work& work = work_[k];
    if (block.holonomic()) {
      block.coefficients(step.start + step.size, q1, work.derivative, work.offset);
      continue;
    }
    work.derivative.setZero();
    for (const StepNode& node : step_nodes(rule_)) {
      const double t = step.start + node.c * step.size;
      q_ = (1.0 - node.c) * q0 + node.c * q1;
      block.coefficients(t, q_, work.coefficients, work.offset);
      work.derivative += node.weight * work.coefficients;
      if (node.c == 0.0) continue;
      block.derivative(t, q_, increment_, step.size, work.node_derivative);
      work.derivative += node.weight * node.c * work.node_derivative;
    }
  }
}

}  // namespace diracstep
