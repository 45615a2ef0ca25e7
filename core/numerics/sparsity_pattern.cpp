#include <algorithm>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <numeric>

namespace diracstep {

SparsityPattern SparsityPattern::diagonal(int n) {
  SparsityPattern pattern;
  pattern.rows_ = n;
  pattern.column_starts_.resize(static_cast<std::size_t>(n) + 1);
  pattern.row_indices_.resize(static_cast<std::size_t>(n));
  std::iota(pattern.column_starts_.begin(), pattern.column_starts_.end(), 0);
  std::iota(pattern.row_indices_.begin(), pattern.row_indices_.end(), 0);
  return pattern;
}

SparsityPattern SparsityPattern::dense(int rows, int columns) {
  SparsityPattern pattern;
  pattern.rows_ = rows;
  pattern.column_starts_.resize(static_cast<std::size_t>(columns) + 1);
  for (int j = 0; j <= columns; ++j) pattern.column_starts_[static_cast<std::size_t>(j)] = j * rows;
  pattern.row_indices_.resize(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns));
  for (int j = 0; j < columns; ++j)
    std::iota(pattern.row_indices_.begin() + j * rows, pattern.row_indices_.begin() + (j + 1) * rows, 0);
  return pattern;
}

SparsityPattern::SparsityPattern(int rows, int columns, const std::vector<std::pair<int, int>>& entries)
    : rows_(rows), column_starts_(static_cast<std::size_t>(columns) + 1, 0), row_indices_(entries.size()) {
  for (const auto& [row, column] : entries) {
    if (row < 0 || row >= rows || column < 0 || column >= columns)
      throw Misuse("sparsity pattern: entry (" + std::to_string(row) + ", " + std::to_string(column) +
                   ") lies outside a " + std::to_string(rows) + " by " + std::to_string(columns) + " matrix");
    ++column_starts_[static_cast<std::size_t>(column) + 1];
  }
  std::partial_sum(column_starts_.begin(), column_starts_.end(), column_starts_.begin());
  std::vector<int> next(column_starts_.begin(), column_starts_.end() - 1);
  for (const auto& [row, column] : entries)
    row_indices_[static_cast<std::size_t>(next[static_cast<std::size_t>(column)]++)] = row;
  sort_columns();
}

/// Rows in ascending order, each one once.
void SparsityPattern::sort_columns() {
  auto kept = row_indices_.begin(), first = kept;
  for (std::size_t j = 1; j < column_starts_.size(); ++j) {
    const auto last = row_indices_.begin() + column_starts_[j];
    std::sort(first, last);
    kept = std::copy(first, std::unique(first, last), kept);
    column_starts_[j] = static_cast<int>(kept - row_indices_.begin());
    first = last;
  }
  row_indices_.erase(kept, row_indices_.end());
  row_indices_.shrink_to_fit();
}

int SparsityPattern::position(int row, int column) const {
  const auto begin = row_indices_.begin() + column_starts_[static_cast<std::size_t>(column)];
  const auto end = row_indices_.begin() + column_starts_[static_cast<std::size_t>(column) + 1];
  const auto found = std::lower_bound(begin, end, row);
  return found != end && *found == row ? static_cast<int>(found - row_indices_.begin()) : -1;
}

std::vector<std::pair<int, int>> SparsityPattern::entries() const {
  std::vector<std::pair<int, int>> entries;
  entries.reserve(row_indices_.size());
  for (int j = 0; j < columns(); ++j)
    for (int k = column_starts_[static_cast<std::size_t>(j)];
         k < column_starts_[static_cast<std::size_t>(j) + 1]; ++k)
      entries.emplace_back(row_indices_[static_cast<std::size_t>(k)], j);
  return entries;
}

SparsityPattern SparsityPattern::transposed(std::vector<int>& order) const {
  auto exchanged = entries();
  for (auto& [row, column] : exchanged) std::swap(row, column);
  SparsityPattern result(columns(), rows_, exchanged);
  order.clear();
  for (const auto& [row, column] : exchanged) order.push_back(result.position(row, column));
  return result;
}

SparsityPattern SparsityPattern::with_diagonal() const {
  auto all = entries();
  for (int i = 0; i < rows_; ++i) all.emplace_back(i, i);
  return {rows_, columns(), all};
}

std::vector<int> SparsityPattern::transposed_positions() const {
  std::vector<int> mirror;
  if (transposed(mirror) != *this)
    throw Misuse("the sparsity pattern of second derivatives is not symmetric");
  return mirror;
}

Columns SparsityPattern::full(ConstVectorRef values) const {
  Columns matrix = Columns::Zero(rows_, columns());
  Eigen::Index k = 0;
  for (const auto& [row, column] : entries()) matrix(row, column) = values[k++];
  return matrix;
}

void SparsityPattern::multiply_add(const double* values, const double* x, double* y, double factor) const {
  for (int j = 0; j < columns(); ++j) {
    const double scaled = factor * x[j];
    for (int k = column_starts_[static_cast<std::size_t>(j)];
         k < column_starts_[static_cast<std::size_t>(j) + 1]; ++k)
      y[row_indices_[static_cast<std::size_t>(k)]] += values[k] * scaled;
  }
}

void SparsityPattern::transposed_multiply_add(const double* values, const double* x, double* y,
                                              double factor) const {
  for (int j = 0; j < columns(); ++j) {
    double sum = 0.0;
    for (int k = column_starts_[static_cast<std::size_t>(j)];
         k < column_starts_[static_cast<std::size_t>(j) + 1]; ++k)
      sum += values[k] * x[row_indices_[static_cast<std::size_t>(k)]];
    y[j] += factor * sum;
  }
}

PatternProduct::PatternProduct(const SparsityPattern& a, bool transpose_a, const SparsityPattern& b,
                               bool transpose_b) {
  struct Entry {
    int row, value;
  };
  // Entries of each column of A or Aᵀ.
  const auto columns_of = [](const SparsityPattern& pattern, bool transpose) {
    std::vector<std::vector<Entry>> columns(
        static_cast<std::size_t>(transpose ? pattern.rows() : pattern.columns()));
    int value = 0;
    for (const auto& [row, column] : pattern.entries()) {
      const int i = transpose ? column : row, j = transpose ? row : column;
      columns[static_cast<std::size_t>(j)].push_back({i, value++});
    }
    return columns;
  };
  const auto left = columns_of(a, transpose_a), right = columns_of(b, transpose_b);
  std::vector<std::pair<int, int>> entries;
  for (std::size_t j = 0; j < right.size(); ++j)
    for (const Entry& eb : right[j])
      for (const Entry& ea : left[static_cast<std::size_t>(eb.row)]) {
        entries.emplace_back(ea.row, static_cast<int>(j));
        terms_.push_back({ea.value, eb.value, 0});
      }
  pattern_ = SparsityPattern(transpose_a ? a.columns() : a.rows(), static_cast<int>(right.size()), entries);
  for (std::size_t k = 0; k < terms_.size(); ++k)
    terms_[k].c = pattern_.position(entries[k].first, entries[k].second);
}

void PatternProduct::multiply(const double* a, const double* b, double* c) const {
  std::fill_n(c, pattern_.nonzeros(), 0.0);
  for (const Term& term : terms_) c[term.c] += a[term.a] * b[term.b];
}

int BlockPattern::add(const SparsityPattern& block, int row, int column, bool transposed) {
  auto& entries = entries_.emplace_back();
  entries.reserve(static_cast<std::size_t>(block.nonzeros()));
  for (const auto& [i, j] : block.entries())
    entries.emplace_back(row + (transposed ? j : i), column + (transposed ? i : j));
  return static_cast<int>(entries_.size()) - 1;
}

SparsityPattern BlockPattern::assemble(bool dense) {
  std::vector<std::pair<int, int>> all;
  for (const auto& entries : entries_) all.insert(all.end(), entries.begin(), entries.end());
  SparsityPattern whole =
      dense ? SparsityPattern::dense(rows_, columns_) : SparsityPattern(rows_, columns_, all);
  for (const auto& entries : entries_) {
    auto& positions = positions_.emplace_back();
    positions.reserve(entries.size());
    for (const auto& [row, column] : entries) positions.push_back(whole.position(row, column));
  }
  entries_.clear();
  entries_.shrink_to_fit();
  return whole;
}

}  // namespace diracstep
