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
      const std::string label = "row '" + block->names()[static_cast<std::size_t>(row)] + "'";
      return origin.empty() ? label : label + " (" + origin + ")";
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
