#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/types.hpp>

namespace diracstep {

/// Largest absolute entry; 0 where there is none.
inline double max_norm(ConstColumnsRef x) { return x.size() == 0 ? 0.0 : x.lpNorm<Eigen::Infinity>(); }

namespace detail {

/// Reductions over long columns go in so many strands: in a single one each entry waits for the last.
constexpr Eigen::Index strands = 8;
using Strands = std::array<double, strands>;

/// Calls take(strand, entry) for every entry.
template <class Take>
inline void for_each_entry(const double* x, Eigen::Index count, Take take) {
  const Eigen::Index whole = count - count % strands;
  for (Eigen::Index i = 0; i < whole; i += strands)
    for (Eigen::Index s = 0; s < strands; ++s) take(s, x[i + s]);
  for (Eigen::Index i = whole; i < count; ++i) take(0, x[i]);
}

}  // namespace detail

/// The same of `count` numbers, without what a call of Eigen's takes; entries that are not numbers do not
/// count.
inline double largest_entry(const double* x, Eigen::Index count) {
  double largest = 0.0;
  if (count < detail::strands) {
    for (Eigen::Index i = 0; i < count; ++i) largest = std::max(largest, std::abs(x[i]));
    return largest;
  }
  detail::Strands each{};
  detail::for_each_entry(x, count, [&](Eigen::Index s, double entry) {
    double& of = each.data()[s];
    of = std::max(of, std::abs(entry));
  });
  for (const double of : each) largest = std::max(largest, of);
  return largest;
}

inline bool all_finite(const double* x, Eigen::Index count) {
  if (count < detail::strands) {
    for (Eigen::Index i = 0; i < count; ++i)
      if (!std::isfinite(x[i])) return false;
    return true;
  }
  detail::Strands zero{};  // stays so: 0 · x is NaN where x is not finite
  detail::for_each_entry(x, count, [&](Eigen::Index s, double entry) { zero.data()[s] += 0.0 * entry; });
  double sum = 0.0;
  for (const double of : zero) sum += of;
  return sum == 0.0;
}

/// Largest absolute entry, NaN where one is not finite; a long column goes through the processor once.
inline double largest_if_finite(const double* x, Eigen::Index count) {
  constexpr Eigen::Index piece = 1024;
  double largest = 0.0;
  for (Eigen::Index i = 0; i < count; i += piece) {
    const Eigen::Index entries = std::min(piece, count - i);
    if (!all_finite(x + i, entries)) return std::nan("");
    largest = std::max(largest, largest_entry(x + i, entries));
  }
  return largest;
}

/// A size of terms to measure residuals by: positive and finite, 1 where none is known.
inline double usable_scale(double scale) { return scale > 0.0 && std::isfinite(scale) ? scale : 1.0; }

}  // namespace diracstep
