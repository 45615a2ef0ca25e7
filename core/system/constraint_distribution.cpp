#include <diracstep/core/system/constraint_distribution.hpp>

namespace diracstep {

ConstraintDistribution::ConstraintDistribution(const ConstraintBlocks& blocks, int dimension)
    : blocks_(blocks), layout_(row_count(blocks), dimension) {
  int row = 0;
  for (const auto& block : blocks_) {
    layout_.add(block->pattern(), row, 0);
    row += block->rows();
    block_values_.emplace_back(Vector::Zero(block->pattern().nonzeros()));
  }
  pattern_ = layout_.assemble(false);
}

/// Calls evaluate(block, first row, values of that block) and puts the values in their places.
template <class Evaluate>
void ConstraintDistribution::for_each_block(VectorRef& values, Evaluate evaluate) {
  if (blocks_.size() == 1) return evaluate(*blocks_.front(), 0, values);
  int row = 0;
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    evaluate(*blocks_[k], row, block_values_[k]);
    row += blocks_[k]->rows();
    const auto& places = layout_.positions(static_cast<int>(k));
    for (std::size_t e = 0; e < places.size(); ++e)
      values[places[e]] = block_values_[k][static_cast<Eigen::Index>(e)];
  }
}

void ConstraintDistribution::coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) {
  for_each_block(a, [&](const ConstraintRows& block, int row, auto& values) {
    block.coefficients(t, q, values, b.segment(row, block.rows()));
  });
}

void ConstraintDistribution::derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) {
  for_each_block(
      d, [&](const ConstraintRows& block, int, auto& values) { block.derivative(t, q, w, s, values); });
}

void ConstraintDistribution::time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) {
  int row = 0;
  for (const auto& block : blocks_) {
    block->time_derivative(t, q, v, d.segment(row, block->rows()));
    row += block->rows();
  }
}

ConstraintsAtPoint::ConstraintsAtPoint(const ConstraintBlocks& blocks, int dimension)
    : distribution_(blocks, dimension),
      a_(Vector::Zero(distribution_.pattern().nonzeros())),
      b_(Vector::Zero(distribution_.rows())) {}

}  // namespace diracstep
