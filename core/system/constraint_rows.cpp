#include <algorithm>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/constraint_rows.hpp>
#include <iterator>

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
  throw Misuse("these constraint rows have no position form φ(t,q)");
}

void ConstraintRows::positions(const PointColumns& at, double* phi) const {
  for (int i = 0; i < at.count; ++i)
    position(at.times[i], column(at.x, dimension(), i), column(phi, rows(), i));
}

void ConstraintRows::coefficients_at(const PointColumns& at, double* a, double* b) const {
  for (int i = 0; i < at.count; ++i)
    coefficients(at.times[i], column(at.x, dimension(), i), column(a, pattern_.nonzeros(), i),
                 column(b, rows(), i));
}

void ConstraintRows::derivatives(const PointColumns& at, double* d) const {
  for (int i = 0; i < at.count; ++i)
    derivative(at.times[i], column(at.x, dimension(), i), column(at.y, dimension(), i), 1.0,
               column(d, pattern_.nonzeros(), i));
}

void ConstraintRows::annihilator_derivatives(const PointColumns& at, const double* multipliers,
                                             double* d) const {
  for (int i = 0; i < at.count; ++i)
    annihilator_derivative(at.times[i], column(at.x, dimension(), i), column(multipliers, rows(), i),
                           column(d, curvature_pattern_.nonzeros(), i));
}

std::string ConstraintRows::origin(int) const { return {}; }

int row_count(const ConstraintBlocks& blocks) {
  int rows = 0;
  for (const auto& block : blocks) rows += block->rows();
  return rows;
}

std::string row_label(const ConstraintBlocks& blocks, int row) {
  for (const auto& block : blocks) {
    if (row < block->rows()) {
      const std::string origin = block->origin(row);
      std::string label = "row '" + block->names()[static_cast<std::size_t>(row)] + "'";
      if (!origin.empty()) label.append(" (").append(origin).append(")");
      return label;
    }
    row -= block->rows();
  }
  throw Misuse("row_label: there is no such row");
}

ConstraintBlocks only_holonomic(const ConstraintBlocks& blocks) {
  ConstraintBlocks some;
  std::ranges::copy_if(blocks, std::back_inserter(some),
                       [](const auto& block) { return block->holonomic(); });
  return some;
}

ConstraintBlocks only_nonholonomic(const ConstraintBlocks& blocks) {
  ConstraintBlocks some;
  std::ranges::copy_if(blocks, std::back_inserter(some),
                       [](const auto& block) { return !block->holonomic(); });
  return some;
}

}  // namespace diracstep
