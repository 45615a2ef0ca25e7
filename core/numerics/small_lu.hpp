#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace diracstep {

/// Elimination by columns with row exchanges, for few unknowns: of fixed size N, or of any size for N = 0.
/// Multipliers that vanish, of which saddle-point matrices have many, are skipped.
template <int N>
class SmallLu {
 public:
  explicit SmallLu(int size)
      : size_(size), lu_(static_cast<std::size_t>(size) * size), inverse_pivots_(size), exchanges_(size) {}

  /// Factors a full matrix given by columns; false where a pivot is round-off beside its column, or no
  /// number.
  bool factor(const double* values) {
    const int n = size();
    std::copy_n(values, n * n, lu_.data());
    const double round_off = std::numeric_limits<double>::epsilon() * n;
    for (int k = 0; k < n; ++k) {
      double* const pivot_column = column(k);
      int pivot = k;
      for (int i = k + 1; i < n; ++i)
        if (std::abs(pivot_column[i]) > std::abs(pivot_column[pivot])) pivot = i;
      if (!(std::abs(pivot_column[pivot]) > round_off * largest(values + k * n))) return false;
      exchanges_[static_cast<std::size_t>(k)] = pivot;
      if (pivot != k)
        for (int j = 0; j < n; ++j) std::swap(column(j)[k], column(j)[pivot]);
      const double inverse = inverse_pivots_[static_cast<std::size_t>(k)] = 1.0 / pivot_column[k];
      for (int i = k + 1; i < n; ++i) pivot_column[i] *= inverse;
      for (int j = k + 1; j < n; ++j) subtract(pivot_column, k, column(j)[k], column(j));
    }
    return true;
  }

  /// Replaces b by the solution.
  void solve(double* b) {
    const int n = size();
    for (int k = 0; k < n; ++k) std::swap(b[k], b[exchanges_[static_cast<std::size_t>(k)]]);
    if constexpr (N >= shortest_unrolled) return substitute(b);
    for (int k = 0; k < n; ++k) subtract(column(k), k, b[k], b);
    for (int k = n - 1; k >= 0; --k) {
      b[k] *= inverse_pivots_[static_cast<std::size_t>(k)];
      for (int i = 0; i < k; ++i) b[i] -= column(k)[i] * b[k];
    }
  }

 private:
  static constexpr int shortest_unrolled = 5;

  int size() const { return N > 0 ? N : size_; }
  double* column(int j) { return lu_.data() + static_cast<std::ptrdiff_t>(j) * size(); }

  /// Of a column, in four strands: in a single one each entry waits for the last.
  double largest(const double* values) const {
    std::array<double, 4> most{};
    const int n = size(), whole = n - n % 4;
    const auto take = [&](int strand, int i) {
      const double entry = std::abs(values[i]);
      most[strand] = entry > most[strand] ? entry : most[strand];
    };
    for (int i = 0; i < whole; i += 4)
      for (int strand = 0; strand < 4; ++strand) take(strand, i + strand);
    for (int i = whole; i < n; ++i) take(0, i);
    return std::max(std::max(most[0], most[1]), std::max(most[2], most[3]));
  }

  /// Substitution with b in registers: each entry waits for the one before it, and where that goes through
  /// memory the waiting takes twice the time.
  void substitute(double* b) const {
    const double* const lu = lu_.data();
    const double* const inverse_pivots = inverse_pivots_.data();
    std::array<double, std::max(N, 1)> held;
    double* const x = held.data();
    std::copy_n(b, N, x);
#pragma GCC unroll 16
    for (int k = 0; k < N; ++k)
#pragma GCC unroll 16
      for (int i = k + 1; i < N; ++i) x[i] -= x[k] * lu[k * N + i];
#pragma GCC unroll 16
    for (int k = N - 1; k >= 0; --k) {
      x[k] *= inverse_pivots[k];
#pragma GCC unroll 16
      for (int i = 0; i < k; ++i) x[i] -= lu[k * N + i] * x[k];
    }
    std::copy_n(x, N, b);
  }

  /// to −= factor · from, below row k.
  void subtract(const double* from, int k, double factor, double* to) const {
    if (factor == 0.0) return;
    for (int i = k + 1; i < size(); ++i) to[i] -= factor * from[i];
  }

  int size_;
  std::vector<double> lu_, inverse_pivots_;
  std::vector<int> exchanges_;
};

}  // namespace diracstep
