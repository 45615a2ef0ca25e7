#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/fewer_entries.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <vector>

namespace diracstep {

namespace {

long entries_of(const Vector& column) { return (column.array() != 0.0).count(); }

/// The sum of column i and another, or their difference, with fewest entries; empty where none has fewer than
/// column i.  Those with about as many come first: a sum has at least as many as the two differ by.
Vector sparsest_sum(const Columns& basis, const std::vector<long>& entries, Eigen::Index i, double zero) {
  const auto at = [](Eigen::Index k) { return static_cast<std::size_t>(k); };
  std::vector<Eigen::Index> others;
  for (Eigen::Index j = 0; j < basis.cols(); ++j)
    if (j != i) others.push_back(j);
  const auto apart = [&](Eigen::Index j) { return std::abs(entries[at(j)] - entries[at(i)]); };
  std::ranges::stable_sort(others, {}, apart);
  Vector best;
  long fewest = entries[at(i)];
  for (const Eigen::Index j : others) {
    if (apart(j) >= fewest) break;
    for (const double sign : {1.0, -1.0}) {
      Vector sum = basis.col(i) + sign * basis.col(j);
      sum = (sum.array().abs() < zero).select(0.0, sum);
      const long count = entries_of(sum);
      if (count == 0 || count >= fewest) continue;
      fewest = count;
      best = sum / max_norm(sum);
    }
  }
  return best;
}

}  // namespace

Columns fewer_entries(Columns basis, double zero) {
  constexpr long few = 3;
  std::vector<long> entries;
  for (Eigen::Index j = 0; j < basis.cols(); ++j) entries.push_back(entries_of(basis.col(j)));
  for (bool changed = true; changed;) {
    changed = false;
    for (Eigen::Index i = basis.cols() - 1; i >= 0; --i) {
      if (entries[static_cast<std::size_t>(i)] <= few) continue;
      const Vector sum = sparsest_sum(basis, entries, i, zero);
      if (sum.size() == 0) continue;
      basis.col(i) = sum;
      entries[static_cast<std::size_t>(i)] = entries_of(sum);
      changed = true;
    }
  }
  return basis;
}

}  // namespace diracstep
