#pragma once

#include <Eigen/SparseCore>
#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <vector>

namespace diracstep {

/// Values on a pattern as a sparse matrix; neither is copied, and both outlive it.
inline Eigen::Map<const Eigen::SparseMatrix<double>> sparse_map(const SparsityPattern& pattern,
                                                                const double* values) {
  return {pattern.rows(),
          pattern.columns(),
          pattern.nonzeros(),
          pattern.column_starts().data(),
          pattern.row_indices().data(),
          values};
}

/// Columns of a matrix, in the order of their numbers.
inline Eigen::SparseMatrix<double> columns_at(const Eigen::SparseMatrix<double>& all,
                                              const std::vector<int>& numbers) {
  Eigen::SparseMatrix<double> chosen(all.rows(), std::ssize(numbers));
  for (std::size_t k = 0; k < numbers.size(); ++k)
    chosen.col(static_cast<Eigen::Index>(k)) = all.col(numbers[k]);
  return chosen;
}

}  // namespace diracstep
