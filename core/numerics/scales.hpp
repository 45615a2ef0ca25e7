#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/types.hpp>
#include <iterator>
#include <span>

namespace diracstep {

/// Largest absolute entry; 0 where there is none.
inline double max_norm(ConstColumnsRef x) { return x.size() == 0 ? 0.0 : x.lpNorm<Eigen::Infinity>(); }

/// A scene at rest moves by the round-off of its coordinates: ways of this part of them count as none.
constexpr double at_rest = 1e-12;

/// Positions may be this part of the lengths in a row, which is then off by round-off of these.
constexpr double part_of_length = 1e-4;

/// Reductions over long columns go in so many strands: in a single one each entry waits for the last.
constexpr std::size_t strands = 8;
using Strands = std::array<double, strands>;

/// Calls take(strand, i) for i from 0 to `count`.
template <class Take>
inline void for_each_in_strands(Eigen::Index count, Take take) {
  constexpr auto width = static_cast<Eigen::Index>(strands);
  const Eigen::Index whole = count - count % width;
  for (Eigen::Index i = 0; i < whole; i += width)
    for (std::size_t s = 0; s < strands; ++s) take(s, i + static_cast<Eigen::Index>(s));
  for (Eigen::Index i = whole; i < count; ++i) take(std::size_t{0}, i);
}

/// Calls visit(first row, rows) piece by piece: work on a long column that takes several passes goes through
/// the processor's cache once.
template <class Visit>
void for_each_piece(int n, Visit visit) {
  constexpr int piece = 1024;
  for (int first = 0; first < n; first += piece) visit(first, std::min(piece, n - first));
}

/// Largest absolute value of value(i) for i from 0 to `count`; what is no number does not count.
template <class Value>
inline double largest_of(Eigen::Index count, Value value) {
  double largest = 0.0;
  if (count < static_cast<Eigen::Index>(strands)) {
    for (Eigen::Index i = 0; i < count; ++i) largest = std::max(largest, std::abs(value(i)));
    return largest;
  }
  Strands each{};
  for_each_in_strands(count, [&](std::size_t s, Eigen::Index i) {
    double& of = each.data()[s];
    of = std::max(of, std::abs(value(i)));
  });
  for (const double of : each) largest = std::max(largest, of);
  return largest;
}

/// The same of the entries of a column, without what a call of Eigen's takes.
inline double largest_entry(const double* x, Eigen::Index count) {
  return largest_of(count, [x](Eigen::Index i) { return x[i]; });
}

/// max |a_k λ_{places[k]}|: the size of the terms of Aᵀλ, places being the rows of the entries a of A.
inline double largest_product(const double* a, std::span<const int> places, const double* lambda) {
  const int* const at = places.data();
  return largest_of(std::ssize(places), [=](Eigen::Index k) { return a[k] * lambda[at[k]]; });
}

inline bool all_finite(const double* x, Eigen::Index count) {
  if (count < static_cast<Eigen::Index>(strands)) {
    for (Eigen::Index i = 0; i < count; ++i)
      if (!std::isfinite(x[i])) return false;
    return true;
  }
  Strands zero{};  // stays so: 0 · x is NaN where x is not finite
  for_each_in_strands(count, [&](std::size_t s, Eigen::Index i) { zero.data()[s] += 0.0 * x[i]; });
  double sum = 0.0;
  for (const double of : zero) sum += of;
  return sum == 0.0;
}

/// Largest absolute entry, NaN where one is not finite.
inline double largest_if_finite(const double* x, int count) {
  double largest = 0.0;
  for_each_piece(count, [&](int first, int entries) {
    if (all_finite(x + first, entries))
      largest = std::max(largest, largest_entry(x + first, entries));
    else
      largest = std::nan("");
  });
  return largest;
}

/// Largest absolute entry; infinite where one is no number.  In two strands: in a single one each entry waits
/// for the last.
inline double largest_or_infinite(const double* x, int count) {
  double largest = 0.0, other = 0.0, sum = 0.0, other_sum = 0.0;  // a sum is finite where its terms are
  for (int i = 0; i + 1 < count; i += 2) {
    const double a = std::abs(x[i]), b = std::abs(x[i + 1]);
    largest = a > largest ? a : largest;
    other = b > other ? b : other;
    sum += a;
    other_sum += b;
  }
  if (count % 2 == 1) {
    sum += std::abs(x[count - 1]);
    largest = std::max(largest, std::abs(x[count - 1]));
  }
  return std::isfinite(sum + other_sum) ? std::max(largest, other) : HUGE_VAL;
}

/// A size to divide by: 1 where it is none.
inline double size_or_one(double size) { return size > 0.0 && std::isfinite(size) ? size : 1.0; }

/// How large a number counts beside others of its kind, as one that is varied or known to some digits: a
/// small one beside a large one as that one, up to 1; 1 where all are zero, as coordinates in the origin.
inline double size_beside(double x, double largest) {
  return std::max(std::abs(x), std::min(1.0, size_or_one(largest)));
}

/// A size of terms to measure residuals by.  None is below this: where all terms vanish, as at rest without a
/// force, so does the residual.
constexpr double smallest_scale = 1e-100;
inline double scale_of(double terms) {
  if (!(terms > smallest_scale)) return smallest_scale;
  return std::isfinite(terms) ? terms : 1.0;  // the residual is not finite either
}

}  // namespace diracstep
