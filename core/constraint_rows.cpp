#include <diracstep/core/constraint_rows.hpp>
#include <diracstep/core/errors.hpp>
#include <stdexcept>

namespace diracstep {

ConstraintRows::ConstraintRows(bool holonomic, SparsityPattern pattern, SparsityPattern curvature_pattern,
                               std::vector<std::string> names)
    : holonomic_(holonomic),
      pattern_(std::move(pattern)),
      curvature_pattern_(std::move(curvature_pattern)),
      names_(std::move(names)) {
  require_size("the list of row names", static_cast<long>(names_.size()), rows());
}

void ConstraintRows::position(double, ConstVectorRef, VectorRef) const {
  throw std::logic_error("these constraint rows have no position form φ(t,q)");
}

int row_count(const ConstraintBlocks& blocks) {
  int rows = 0;
  for (const auto& block : blocks) rows += block->rows();
  return rows;
}

ConstraintsAtPoint::ConstraintsAtPoint(const ConstraintBlocks& blocks) : blocks_(blocks) {
  for (const auto& block : blocks) {
    a_.emplace_back(Vector::Zero(block->pattern().nonzeros()));
    b_.emplace_back(Vector::Zero(block->rows()));
  }
}

void ConstraintsAtPoint::evaluate(double t, ConstVectorRef q) {
  for (std::size_t k = 0; k < blocks_.size(); ++k) blocks_[k]->coefficients(t, q, a_[k], b_[k]);
}

void ConstraintsAtPoint::add_annihilator(ConstVectorRef lambda, VectorRef out, double factor) const {
  int row = 0;
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    blocks_[k]->pattern().transposed_multiply_add(a_[k].data(), lambda.data() + row, out.data(), factor);
    row += blocks_[k]->rows();
  }
}

void ConstraintsAtPoint::velocity_residual(ConstVectorRef v, VectorRef out) const {
  int row = 0;
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    out.segment(row, blocks_[k]->rows()) = b_[k];
    blocks_[k]->pattern().multiply_add(a_[k].data(), v.data(), out.data() + row);
    row += blocks_[k]->rows();
  }
}

}  // namespace diracstep
