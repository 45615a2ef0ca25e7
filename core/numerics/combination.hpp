#pragma once

#include <array>

namespace diracstep {

namespace detail {

template <int N>
void combine_fixed(int terms, const double* weights, const double* columns, const double* base, double* to) {
  std::array<double, N> sum{};
  for (int k = 0; k < terms; ++k)
    for (std::size_t r = 0; r < N; ++r) sum[r] += weights[k] * columns[k * N + static_cast<int>(r)];
  for (std::size_t r = 0; r < N; ++r) to[r] = base == nullptr ? sum[r] : base[r] + sum[r];
}

/// `rows` of n rows; by eights, which the processor adds side by side.
inline void combine_any(int rows, int n, int terms, const double* weights, const double* columns,
                        const double* base, double* to) {
  constexpr int side_by_side = 8;
  const int whole = rows - rows % side_by_side;
  for (int r = 0; r < whole; r += side_by_side) {
    std::array<double, side_by_side> sum{};
    for (int k = 0; k < terms; ++k) {
      const double* const column = columns + static_cast<long>(k) * n + r;
      for (std::size_t l = 0; l < side_by_side; ++l) sum[l] += weights[k] * column[l];
    }
    for (std::size_t l = 0; l < side_by_side; ++l) {
      const std::size_t at = static_cast<std::size_t>(r) + l;
      to[at] = base == nullptr ? sum[l] : base[at] + sum[l];
    }
  }
  for (int r = whole; r < rows; ++r) {
    double sum = 0.0;
    for (int k = 0; k < terms; ++k) sum += weights[k] * columns[static_cast<long>(k) * n + r];
    to[r] = base == nullptr ? sum : base[r] + sum;
  }
}

}  // namespace detail

/// to = base + Σ_k weights[k] x_k for `terms` columns x_k of n numbers, one behind the other; the sum, of
/// small terms, is taken first.  No base is null; `to` may be the base.  A step has few coordinates: where n
/// is small the loops are of fixed length, so that they cost little beside their arithmetic.
inline void combine(int n, int terms, const double* weights, const double* columns, const double* base,
                    double* to) {
  switch (n) {
    case 1:
      return detail::combine_fixed<1>(terms, weights, columns, base, to);
    case 2:
      return detail::combine_fixed<2>(terms, weights, columns, base, to);
    case 3:
      return detail::combine_fixed<3>(terms, weights, columns, base, to);
    case 4:
      return detail::combine_fixed<4>(terms, weights, columns, base, to);
    case 5:
      return detail::combine_fixed<5>(terms, weights, columns, base, to);
    case 6:
      return detail::combine_fixed<6>(terms, weights, columns, base, to);
    case 9:
      return detail::combine_fixed<9>(terms, weights, columns, base, to);
    default:
      return detail::combine_any(n, n, terms, weights, columns, base, to);
  }
}

/// combine() of a piece.
inline void combine_piece(int first, int rows, int n, int terms, const double* weights, const double* columns,
                          const double* base, double* to) {
  if (rows == n) return combine(n, terms, weights, columns, base, to);
  detail::combine_any(rows, n, terms, weights, columns + first, base == nullptr ? base : base + first,
                      to + first);
}

}  // namespace diracstep
