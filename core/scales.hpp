#pragma once

#include <algorithm>
#include <cmath>
#include <diracstep/core/types.hpp>

namespace diracstep {

/// The processor works on so many entries at once; one after the other each waits for the last.
constexpr Eigen::Index entries_side_by_side = 4;

/// Largest absolute entry; 0 where there is none.
inline double max_norm(ConstColumnsRef x) { return x.size() == 0 ? 0.0 : x.lpNorm<Eigen::Infinity>(); }

/// The same of `count` numbers, without what a call of Eigen's takes; entries that are not numbers do not
/// count.
inline double largest_entry(const double* x, Eigen::Index count) {
  using Lanes = Eigen::Array<double, entries_side_by_side, 1>;
  const Eigen::Index whole = count - count % entries_side_by_side;
  Lanes lanes = Lanes::Zero();
  for (Eigen::Index i = 0; i < whole; i += entries_side_by_side)
    lanes = lanes.max(Eigen::Map<const Lanes>(x + i).abs());
  double largest = 0.0;
  for (const double lane : lanes) largest = std::max(largest, lane);
  for (Eigen::Index i = whole; i < count; ++i) largest = std::max(largest, std::abs(x[i]));
  return largest;
}

inline bool all_finite(const double* x, Eigen::Index count) {
  using Lanes = Eigen::Array<double, entries_side_by_side, 1>;
  const Eigen::Index whole = count - count % entries_side_by_side;
  Lanes zeros = Lanes::Zero();  // what is not finite is no zero when multiplied by it
  for (Eigen::Index i = 0; i < whole; i += entries_side_by_side)
    zeros += 0.0 * Eigen::Map<const Lanes>(x + i);
  if (zeros.sum() != 0.0) return false;
  for (Eigen::Index i = whole; i < count; ++i)
    if (!std::isfinite(x[i])) return false;
  return true;
}

/// A size of terms to measure residuals by: positive and finite, 1 where none is known.
inline double usable_scale(double scale) { return scale > 0.0 && std::isfinite(scale) ? scale : 1.0; }

}  // namespace diracstep
