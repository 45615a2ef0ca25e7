#include <diracstep/core/dirac/discrete_constraint.hpp>

namespace diracstep {

DiscreteConstraint::DiscreteConstraint(const ConstraintBlocks& blocks, int dimension,
                                       const ConstraintRule& rule)
    : rule_(rule.nodes),
      own_{rule.own, {}, {}, {}},
      layout_(row_count(blocks), dimension),
      q_(Vector::Zero(dimension)),
      increment_(Vector::Zero(dimension)) {
  int row = 0;
  std::vector<int> own_places;
  for (const auto& block : blocks) {
    const Vector values = Vector::Zero(block->pattern().nonzeros());
    if (own_.rows && !block->holonomic()) {
      for (int r = 0; r < block->rows(); ++r) own_places.push_back(row + r);
    } else {
      blocks_.push_back({block, row, values, Vector::Zero(block->rows()), values, values});
      layout_.add(block->pattern(), row, 0);
    }
    row += block->rows();
  }
  if (own_.rows) plan_own(std::move(own_places), dimension);
  pattern_ = layout_.assemble(false);
}

/// The places of rows ascend, so the entries keep their order.
void DiscreteConstraint::plan_own(std::vector<int> places, int dimension) {
  own_.places = std::move(places);
  auto entries = own_.rows->pattern().entries();
  for (auto& [row, column] : entries) row = own_.places.at(static_cast<std::size_t>(row));
  layout_.add({layout_.rows(), dimension, entries}, 0, 0);
  own_.values.setZero(own_.rows->rows());
  own_.derivative.setZero(own_.rows->pattern().nonzeros());
}

void DiscreteConstraint::residual(Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef out) {
  increment_ = q1 - q0;
  residual(step, q0, q1, increment_, out);
}

void DiscreteConstraint::residual(Interval step, ConstVectorRef q0, ConstVectorRef q1,
                                  ConstVectorRef increment, VectorRef out) {
  if (increment.data() != increment_.data()) increment_ = increment;
  for (Block& block : blocks_) residual(block, step, q0, q1, out.segment(block.first, block.rows->rows()));
  if (!own_.rows) return;
  own_.rows->residual(step, q0, q1, own_.values);
  for (std::size_t r = 0; r < own_.places.size(); ++r)
    out[own_.places[r]] = own_.values[static_cast<Eigen::Index>(r)];
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
  if (!own_.rows) return;
  own_.rows->end_derivative(step, q0, q1, own_.derivative);
  const auto& places = layout_.positions(static_cast<int>(blocks_.size()));
  for (std::size_t e = 0; e < places.size(); ++e)
    d[places[e]] = own_.derivative[static_cast<Eigen::Index>(e)];
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
