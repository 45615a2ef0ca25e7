#include <diracstep/core/discrete_constraint.hpp>

namespace diracstep {

DiscreteConstraint::DiscreteConstraint(const ConstraintBlocks& blocks, int dimension, StepRule rule)
    : rule_(rule),
      layout_(row_count(blocks), dimension),
      q_(Vector::Zero(dimension)),
      increment_(Vector::Zero(dimension)) {
  int row = 0;
  for (const auto& block : blocks) {
    const Vector values = Vector::Zero(block->pattern().nonzeros());
    blocks_.push_back({block, values, Vector::Zero(block->rows()), values, values});
    layout_.add(block->pattern(), row, 0);
    row += block->rows();
  }
  pattern_ = layout_.assemble(false);
}

void DiscreteConstraint::residual(Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef out) {
  increment_ = q1 - q0;
  int row = 0;
  for (Block& block : blocks_) {
    residual(block, step, q0, q1, out.segment(row, block.rows->rows()));
    row += block.rows->rows();
  }
}

void DiscreteConstraint::residual(Block& block, Interval step, ConstVectorRef q0, ConstVectorRef q1,
                                  VectorRef c) {
  if (block.rows->holonomic()) return block.rows->position(step.start + step.size, q1, c);
  c.setZero();
  for (const StepNode& node : step_nodes(rule_)) {
    q_ = (1.0 - node.c) * q0 + node.c * q1;
    block.rows->coefficients(step.start + node.c * step.size, q_, block.coefficients, block.offset);
    c += node.weight * step.size * block.offset;
    block.rows->pattern().multiply_add(block.coefficients.data(), increment_.data(), c.data(), node.weight);
  }
}

void DiscreteConstraint::end_derivative(Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef d) {
  increment_ = q1 - q0;
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    end_derivative(blocks_[k], step, q0, q1);
    const auto& places = layout_.positions(static_cast<int>(k));
    for (std::size_t e = 0; e < places.size(); ++e)
      d[places[e]] = blocks_[k].derivative[static_cast<Eigen::Index>(e)];
  }
}

void DiscreteConstraint::end_derivative(Block& block, Interval step, ConstVectorRef q0, ConstVectorRef q1) {
  if (block.rows->holonomic())
    return block.rows->coefficients(step.start + step.size, q1, block.derivative, block.offset);
  block.derivative.setZero();
  for (const StepNode& node : step_nodes(rule_)) {
    const double t = step.start + node.c * step.size;
    q_ = (1.0 - node.c) * q0 + node.c * q1;
    block.rows->coefficients(t, q_, block.coefficients, block.offset);
    block.derivative += node.weight * block.coefficients;
    if (node.c == 0.0) continue;
    block.rows->derivative(t, q_, increment_, step.size, block.node_derivative);
    block.derivative += node.weight * node.c * block.node_derivative;
  }
}

}  // namespace diracstep
