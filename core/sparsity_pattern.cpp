#include <algorithm>
#include <diracstep/core/errors.hpp>
#include <diracstep/core/sparsity_pattern.hpp>
#include <numeric>

namespace diracstep {

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

SparsityPattern::SparsityPattern(int rows, int columns, std::vector<std::pair<int, int>> entries)
    : rows_(rows), column_starts_(static_cast<std::size_t>(columns) + 1, 0) {
  std::ranges::sort(entries, [](const auto& a, const auto& b) {
    return std::pair(a.second, a.first) < std::pair(b.second, b.first);
  });
  entries.erase(std::unique(entries.begin(), entries.end()), entries.end());
  row_indices_.reserve(entries.size());
  for (const auto& [row, column] : entries) {
    if (row < 0 || row >= rows || column < 0 || column >= columns)
      throw Misuse("sparsity pattern: entry (" + std::to_string(row) + ", " + std::to_string(column) +
                   ") lies outside a " + std::to_string(rows) + " by " + std::to_string(columns) +
                   " matrix");
    ++column_starts_[static_cast<std::size_t>(column) + 1];
    row_indices_.push_back(row);
  }
  std::partial_sum(column_starts_.begin(), column_starts_.end(), column_starts_.begin());
}

int SparsityPattern::position(int row, int column) const {
  const auto begin = row_indices_.begin() + column_starts_[static_cast<std::size_t>(column)];
  const auto end = row_indices_.begin() + column_starts_[static_cast<std::size_t>(column) + 1];
  const auto found = std::lower_bound(begin, end, row);
  return found != end && *found == row ? static_cast<int>(found - row_indices_.begin()) : -1;
}

std::vector<int> SparsityPattern::transposed_positions() const {
  std::vector<int> mirror;
  mirror.reserve(row_indices_.size());
  for (int j = 0; j < columns(); ++j)
    for (int k = column_starts_[static_cast<std::size_t>(j)];
         k < column_starts_[static_cast<std::size_t>(j) + 1]; ++k)
      mirror.push_back(position(j, row_indices_[static_cast<std::size_t>(k)]));
  if (std::ranges::find(mirror, -1) != mirror.end())
    throw Misuse("sparsity pattern of second derivatives is not symmetric");
  return mirror;
}

void SparsityPattern::multiply_add(const double* values, const double* x, double* y,
                                   double factor) const {
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

int BlockPattern::add(const SparsityPattern& block, int row, int column, bool transposed) {
  auto& entries = entries_.emplace_back();
  entries.reserve(static_cast<std::size_t>(block.nonzeros()));
  for (int j = 0; j < block.columns(); ++j)
    for (int k = block.column_starts()[static_cast<std::size_t>(j)];
         k < block.column_starts()[static_cast<std::size_t>(j) + 1]; ++k) {
      const int i = block.row_indices()[static_cast<std::size_t>(k)];
      entries.emplace_back(row + (transposed ? j : i), column + (transposed ? i : j));
    }
  return static_cast<int>(entries_.size()) - 1;
}

SparsityPattern BlockPattern::assemble(bool dense) {
  std::vector<std::pair<int, int>> all;
  for (const auto& entries : entries_) all.insert(all.end(), entries.begin(), entries.end());
  const SparsityPattern whole = dense ? SparsityPattern::dense(rows_, columns_)
                                      : SparsityPattern(rows_, columns_, std::move(all));
  for (const auto& entries : entries_) {
    auto& positions = positions_.emplace_back();
    positions.reserve(entries.size());
    for (const auto& [row, column] : entries) positions.push_back(whole.position(row, column));
  }
  entries_.clear();
  return whole;
}

}  // namespace diracstep
