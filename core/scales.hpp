#pragma once

#include <algorithm>
#include <cmath>
#include <diracstep/core/types.hpp>

namespace diracstep {

/// Largest absolute entry; 0 where there is none.
inline double max_norm(ConstColumnsRef x) { return x.size() == 0 ? 0.0 : x.lpNorm<Eigen::Infinity>(); }

/// The same of `count` numbers, without what a call of Eigen's takes; entries that are not numbers do not
/// count.
inline double largest_entry(const double* x, Eigen::Index count) {
  double largest = 0.0;
  for (Eigen::Index i = 0; i < count; ++i) largest = std::max(largest, std::abs(x[i]));
  return largest;
}

inline bool all_finite(const double* x, Eigen::Index count) {
  for (Eigen::Index i = 0; i < count; ++i)
    if (!std::isfinite(x[i])) return false;
  return true;
}

/// A size of terms to measure residuals by: positive and finite, 1 where none is known.
inline double usable_scale(double scale) { return scale > 0.0 && std::isfinite(scale) ? scale : 1.0; }

}  // namespace diracstep
