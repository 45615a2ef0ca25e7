#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <span>
#include <utility>
#include <vector>

namespace diracstep {

/// Where a matrix may be non-zero, in compressed columns with ascending rows.  Values live apart, in an array
/// of length nonzeros() in the same order; a dense pattern is the column-major full matrix, so dense and
/// sparse matrices share every line of assembly.
class SparsityPattern {
 public:
  SparsityPattern() : column_starts_{0} {}
  static SparsityPattern dense(int rows, int columns);
  /// n×n.
  static SparsityPattern diagonal(int n);

  /// From (row, column) pairs in any order; repeated pairs count once.
  SparsityPattern(int rows, int columns, const std::vector<std::pair<int, int>>& entries);

  int rows() const { return rows_; }
  int columns() const { return static_cast<int>(column_starts_.size()) - 1; }
  int nonzeros() const { return column_starts_.back(); }
  bool is_dense() const { return nonzeros() == static_cast<long>(rows_) * columns(); }
  std::span<const int> column_starts() const { return column_starts_; }
  std::span<const int> row_indices() const { return row_indices_; }

  /// (row, column) of every value, in order.
  std::vector<std::pair<int, int>> entries() const;

  /// Calls visit(index of the value, row, column) for every value, in order.
  template <class Visit>
  void for_each(Visit visit) const {
    for (int column = 0, k = 0; column < columns(); ++column)
      for (; k < column_starts_[static_cast<std::size_t>(column) + 1]; ++k)
        visit(Eigen::Index{k}, row_indices_[static_cast<std::size_t>(k)], column);
  }

  /// This square pattern with every diagonal entry added.
  SparsityPattern with_diagonal() const;

  /// Index into the values of entry (row, column), or -1 where the pattern has none.
  int position(int row, int column) const;

  /// The same entries with rows and columns exchanged; value k of this pattern is value order[k] of the
  /// other.
  SparsityPattern transposed(std::vector<int>& order) const;

  /// For each value of this square pattern the position of its mirror entry, which must exist.
  std::vector<int> transposed_positions() const;

  /// The full matrix of these values.
  Columns full(ConstVectorRef values) const;

  /// y += factor · M x   and   y += factor · Mᵀ x.
  void multiply_add(const double* values, const double* x, double* y, double factor = 1.0) const;
  void transposed_multiply_add(const double* values, const double* x, double* y, double factor = 1.0) const;

  bool operator==(const SparsityPattern&) const = default;

 private:
  void sort_columns();

  int rows_ = 0;
  std::vector<int> column_starts_;
  std::vector<int> row_indices_;
};

/// A product of two matrices on fixed patterns, either of them transposed: the pattern of the product, and
/// for each value of it which products of values add up to it.
class PatternProduct {
 public:
  PatternProduct() = default;
  PatternProduct(const SparsityPattern& a, bool transpose_a, const SparsityPattern& b, bool transpose_b);

  const SparsityPattern& pattern() const { return pattern_; }
  /// c = A B on pattern().
  void multiply(const double* a, const double* b, double* c) const;

 private:
  struct Term {
    int a, b, c;  ///< positions of values
  };
  SparsityPattern pattern_;
  std::vector<Term> terms_;
};

/// A matrix pattern made of blocks, and for each block where its values go in the whole.
class BlockPattern {
 public:
  BlockPattern(int rows, int columns) : rows_(rows), columns_(columns) {}

  int rows() const { return rows_; }

  /// Adds `block` with its corner at (row, column), transposed if asked; returns the block's number.
  int add(const SparsityPattern& block, int row, int column, bool transposed = false);

  /// The whole pattern, once every block is added; `dense` fills it up.
  SparsityPattern assemble(bool dense);

  /// positions(b)[k] is the place in the whole of value k of block b.
  const std::vector<int>& positions(int block) const { return positions_[static_cast<std::size_t>(block)]; }

  /// Adds factor times the values of a block to those of the whole.
  void add_to(double* whole, int block, double factor, const double* values) const {
    for (const int place : positions(block)) whole[place] += factor * *values++;
  }

 private:
  int rows_;
  int columns_;
  std::vector<std::vector<std::pair<int, int>>> entries_;
  std::vector<std::vector<int>> positions_;
};

}  // namespace diracstep
