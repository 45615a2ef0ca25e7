#pragma once

#include <Eigen/SparseCore>
#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <utility>
#include <vector>

/// The derivatives of a step are written once, in full or in sparse matrices: `Matrix` is Columns or Sparse.
namespace diracstep::sensitivity {

using Sparse = Eigen::SparseMatrix<double>;

/// A sum of blocks.
template <class Matrix>
class BlockSum;

template <>
class BlockSum<Columns> {
 public:
  BlockSum(Eigen::Index rows, Eigen::Index columns) : sum_(Columns::Zero(rows, columns)) {}
  template <class Block>
  void add(Eigen::Index row, Eigen::Index column, const Block& block, double factor = 1.0) {
    sum_.block(row, column, block.rows(), block.cols()) += factor * block;
  }
  void add_identity(Eigen::Index row, Eigen::Index column, int n, double factor = 1.0) {
    sum_.block(row, column, n, n).diagonal().array() += factor;
  }
  Columns result() { return std::move(sum_); }

 private:
  Columns sum_;
};

template <>
class BlockSum<Sparse> {
 public:
  BlockSum(Eigen::Index rows, Eigen::Index columns) : sum_(rows, columns) {}
  void add(Eigen::Index row, Eigen::Index column, const Sparse& block, double factor = 1.0) {
    for (int c = 0; c < block.outerSize(); ++c)
      for (Sparse::InnerIterator e(block, c); e; ++e)
        entries_.emplace_back(static_cast<int>(row) + e.row(), static_cast<int>(column) + c,
                              factor * e.value());
  }
  void add_identity(Eigen::Index row, Eigen::Index column, int n, double factor = 1.0) {
    for (int i = 0; i < n; ++i)
      entries_.emplace_back(static_cast<int>(row) + i, static_cast<int>(column) + i, factor);
  }
  Sparse result() {
    sum_.setFromTriplets(entries_.begin(), entries_.end());
    return sum_;  // a sparse matrix of Eigen 3.4 cannot be moved
  }

 private:
  Sparse sum_;
  std::vector<Eigen::Triplet<double>> entries_;
};

template <class Matrix>
Matrix zero(Eigen::Index rows, Eigen::Index columns) {
  return BlockSum<Matrix>(rows, columns).result();
}

/// Rows from `row` and columns from `column` on of the matrix with such values on a pattern.
template <class Matrix>
Matrix part_of(const SparsityPattern& pattern, const double* values, int row, int rows, int column,
               int columns);

template <>
inline Columns part_of<Columns>(const SparsityPattern& pattern, const double* values, int row, int rows,
                                int column, int columns) {
  if (pattern.is_dense())
    return Eigen::Map<const Columns>(values, pattern.rows(), pattern.columns())
        .block(row, column, rows, columns);
  Columns part = Columns::Zero(rows, columns);
  pattern.for_each([&](Eigen::Index e, int r, int c) {
    if (r >= row && r < row + rows && c >= column && c < column + columns)
      part(r - row, c - column) = values[e];
  });
  return part;
}

template <>
inline Sparse part_of<Sparse>(const SparsityPattern& pattern, const double* values, int row, int rows,
                              int column, int columns) {
  const auto starts = pattern.column_starts(), indices = pattern.row_indices();
  Sparse part(rows, columns);
  part.reserve(pattern.nonzeros());
  for (int c = 0; c < columns; ++c) {  // in the order of the pattern
    part.startVec(c);
    const auto in_pattern = static_cast<std::size_t>(column) + static_cast<std::size_t>(c);
    for (int e = starts[in_pattern]; e < starts[in_pattern + 1]; ++e)
      if (const int r = indices[static_cast<std::size_t>(e)]; r >= row && r < row + rows)
        part.insertBack(r - row, c) = values[e];
  }
  part.finalize();
  return part;
}

/// The whole of it.
template <class Matrix>
Matrix matrix_of(const SparsityPattern& pattern, const Vector& values) {
  return part_of<Matrix>(pattern, values.data(), 0, pattern.rows(), 0, pattern.columns());
}

/// The first columns.
inline Columns left_columns(const Columns& m, int count) { return m.leftCols(count); }
inline Sparse left_columns(const Sparse& m, int count) { return m.leftCols(count); }

}  // namespace diracstep::sensitivity
