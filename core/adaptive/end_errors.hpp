#pragma once

#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <limits>

namespace diracstep::detail {

inline constexpr double no_size = 1e-14;  // of the largest on the way: an end that comes back to zero

/// What errors of a column at the end are parts of: of the largest on the way where nothing is left of it.
inline double size_at_end(const Vector& column, double largest) {
  const double size = max_norm(column);
  return size > no_size * largest ? size : largest;
}

/// What rounding adds up to in a run: no error is known to be smaller.
inline double round_off_of(long steps) {
  return std::numeric_limits<double>::epsilon() * std::sqrt(static_cast<double>(std::max(1L, steps)));
}

inline double relative_change(const Vector& a, const Vector& b, double largest) {
  const double change = max_norm(a - b);
  return change == 0.0 ? 0.0 : change / size_at_end(b, largest);
}

}  // namespace diracstep::detail
