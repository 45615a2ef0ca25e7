#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace diracstep {

/// The inverse of a matrix of N unknowns, N small, by Gauss–Jordan elimination with row exchanges.  Taking it
/// costs three times as much as factors; but its product with a column is one of independent sums, where
/// substitution waits for one entry after the other.  So it is for a matrix that many columns are solved
/// with, in an iteration that corrects what its round-off leaves.
template <int N>
class SmallInverse {
 public:
  /// Of a full matrix given by columns; of one whose pivot is round-off beside its column, or no number, the
  /// inverse is NaN.
  void invert(const double* values) {
    std::array<std::array<double, 2 * N>, N> rows{};
    std::array<double, N> largest{};
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j < N; ++j) {
        rows[i][j] = values[i + N * j];
        largest[j] = std::max(largest[j], std::abs(rows[i][j]));
      }
      rows[i][N + i] = 1.0;
    }
    for (int k = 0; k < N; ++k) {
      int pivot = k;
      for (int i = k + 1; i < N; ++i)
        if (std::abs(rows[i][k]) > std::abs(rows[pivot][k])) pivot = i;
      if (!(std::abs(rows[pivot][k]) > N * std::numeric_limits<double>::epsilon() * largest[k])) {
        inverse_.fill(std::numeric_limits<double>::quiet_NaN());
        return;
      }
      if (pivot != k) std::swap(rows[k], rows[pivot]);
      eliminate(rows, k);
    }
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j) inverse_[i + N * j] = rows[i][N + j];
  }

  /// Replaces b by the solution.
  void solve(double* b) const {
    std::array<double, N> sum{};
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < N; ++i) sum[i] += inverse_[i + N * j] * b[j];
    std::copy_n(sum.data(), N, b);
  }

 private:
  /// Makes column k one of the unit matrix; what stands on its left is so already.
  static void eliminate(std::array<std::array<double, 2 * N>, N>& rows, int k) {
    const double inverse = 1.0 / rows[k][k];
    for (int c = 0; c < 2 * N; ++c) rows[k][c] *= inverse;
    for (int i = 0; i < N; ++i) {
      if (i == k) continue;
      const double factor = rows[i][k];
      for (int c = 0; c < 2 * N; ++c) rows[i][c] -= factor * rows[k][c];
    }
  }

  std::array<double, N * N> inverse_{};  ///< by columns
};

}  // namespace diracstep
