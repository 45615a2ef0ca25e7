#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/constraint_rows.hpp>

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

int row_count(const ConstraintBlocks& blocks) {
  int rows = 0;
  for (const auto& block : blocks) rows += block->rows();
  return rows;
}

}  // namespace diracstep
