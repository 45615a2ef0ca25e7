#pragma once

#include <array>
#include <cstring>
#include <diracstep/core/numerics/sparsity_pattern.hpp>

namespace diracstep::detail {

/// Columns that do not overlap, of a length known here.
template <int count>
inline void copy(const double* from, double* to) {
  std::memcpy(to, from, count * sizeof(double));
}

/// Values on a pattern as full columns.
template <int rows, int columns>
class FullBlocks {
 public:
  explicit FullBlocks(const SparsityPattern& pattern) : entries_(pattern.nonzeros()) {
    for (const auto& [row, column] : pattern.entries()) places_[count_++] = row + rows * column;
  }
  int entries() const { return entries_; }
  /// to = the values, zero elsewhere.
  void expand(const double* values, double* to) const {
    if (entries_ == rows * columns) {
      copy<rows * columns>(values, to);
      return;
    }
    for (int e = 0; e < rows * columns; ++e) to[e] = 0.0;
    for (int e = 0; e < entries_; ++e) to[places_[e]] = values[e];
  }

 private:
  int entries_, count_ = 0;
  std::array<int, rows * columns> places_{};
};

}  // namespace diracstep::detail
