#pragma once

#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <limits>

namespace diracstep::detail {

inline constexpr double no_size = 1e-14;  // of the largest on the way: an end that comes back to zero

/// Sizes of a column on the way.
struct WaySize {
  double largest = 0.0;     ///< at the nodes read
  double unbalanced = 0.0;  ///< what forces that balance each other would bring it to: RestSizes

  void see(double size, double at_rest_size) {
    largest = std::max(largest, size);
    unbalanced = std::max(unbalanced, at_rest_size);
  }
};

/// What errors of a column at the end are parts of: of the largest on the way where nothing but round-off, of
/// it or of balanced forces, is left.
inline double size_at_end(const Vector& column, const WaySize& way) {
  const double size = max_norm(column);
  return size > std::max(no_size * way.largest, at_rest * way.unbalanced)
             ? size
             : std::max(way.largest, way.unbalanced);
}

/// What rounding adds up to in a run: no error is known to be smaller.
inline double round_off_of(long steps) {
  return std::numeric_limits<double>::epsilon() * std::sqrt(static_cast<double>(std::max(1L, steps)));
}

inline double relative_change(const Vector& a, const Vector& b, const WaySize& way) {
  const double change = max_norm(a - b);
  return change == 0.0 ? 0.0 : change / size_at_end(b, way);
}

}  // namespace diracstep::detail
