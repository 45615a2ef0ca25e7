#pragma once

#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <vector>

namespace diracstep {

/// Scales of single rows, for a problem whose rows have terms of very different sizes: a light oscillator
/// beside a heavy one is solved to the size of its own terms, which round-off in the row is a part of.
///
/// A row shares the scale of its block unless its terms are less than a thousandth of that.  Below, its scale
/// is the larger of
///   a thousand times its terms: their sizes are known from first derivatives of the row alone, so that what
///     its functions lose inside is not among them;
///   where functions are not known to be quadratic, what its terms would be if its coordinates were as large
///     and as fast as the largest and fastest of all: e^x - e^y loses the same digits however small x and y
///     are.
class RowScales {
 public:
  explicit RowScales(Eigen::Index rows = 0) : scales_(Vector::Zero(rows)) {}

  /// How many times its own terms a scale of a row is.
  static constexpr double margin = 1e3;

  /// Whether each of `n` rows f is at most `level` times its scale, if terms[i] are among the terms of row i.
  static bool solved(const double* f, const double* terms, int n, double level) {
    const double allowed = level * margin;
    bool all = true;
    for (int i = 0; i < n; ++i) all &= std::abs(f[i]) <= allowed * std::abs(terms[i]);
    return all;
  }

  /// The rows from `first` on have terms of these sizes, and of those sizes where all coordinates are as
  /// large as the largest, in a block of this scale.
  void set(Eigen::Index first, ConstVectorRef terms, ConstVectorRef largest, double block_scale) {
    for (Eigen::Index i = 0; i < terms.size(); ++i) {
      const double own = std::max({margin * terms[i], largest[i], smallest_part * block_scale});
      scales_[first + i] = own < block_scale ? own : block_scale;
    }
  }

  /// Sizes to take coordinates for that are not judged by their own: the largest of all, or what these
  /// tolerances, where stated, are `level` of.
  static void set_largest(Vector& sizes, double largest, const Vector& tolerances, double level) {
    sizes.setConstant(largest);
    for (Eigen::Index i = 0; i < tolerances.size(); ++i)
      if (tolerances[i] > 0.0) sizes[i] = tolerances[i] / level;
  }

  /// The scales, where a row of f is more than `level` times its own; null where none is.
  const double* unsolved(ConstVectorRef f, double level) const {
    for (Eigen::Index i = 0; i < scales_.size(); ++i)
      if (!(std::abs(f[i]) <= level * scales_[i])) return scales_.data();
    return nullptr;
  }

 private:
  /// Where the only term of a row has to vanish, as a multiplier of a row without force, it is done here.
  static constexpr double smallest_part = 1e-30;

  Vector scales_;
};

/// One term of each row of a matrix, known as a large one, which bounds the terms of the row from below: a
/// row that is small beside it need not be looked at any closer.
class LeadingTerms {
 public:
  explicit LeadingTerms(const SparsityPattern& pattern)
      : terms_(static_cast<std::size_t>(pattern.rows())), sizes_(Vector::Zero(pattern.rows())) {
    pattern.for_each([this](Eigen::Index e, int r, int c) { terms_[static_cast<std::size_t>(r)] = {e, c}; });
  }

  /// Whether each row f[r], r = 0, 1, …, is at most `allowed` times its term, of the size given by
  /// size_of(entry, column); `copies` of them, with `stride` between.
  template <class SizeOf>
  bool bound(const double* f, int copies, int stride, double allowed, SizeOf size_of) const {
    bool all = true;
    for (std::size_t r = 0; r < terms_.size(); ++r) {
      const double most = allowed * size_of(terms_[r].entry, terms_[r].column);
      for (int copy = 0; copy < copies; ++copy)
        all &= std::abs(f[static_cast<std::ptrdiff_t>(r) + stride * copy]) <= most;
    }
    return all;
  }

  /// sizes[r] = the sum of all terms of row r; the largest of them is the leading one from now on.
  template <class SizeOf>
  void add_up(const SparsityPattern& pattern, double* sizes, SizeOf size_of) {
    std::fill_n(sizes, terms_.size(), 0.0);
    sizes_.setZero();
    pattern.for_each([&](Eigen::Index e, int r, int c) {
      const double size = size_of(e, c);
      sizes[r] += size;
      if (size <= sizes_[r]) return;
      sizes_[r] = size;
      terms_[static_cast<std::size_t>(r)] = {e, c};
    });
  }

 private:
  struct Term {
    Eigen::Index entry = 0;
    int column = 0;
  };
  std::vector<Term> terms_;
  Vector sizes_;
};

}  // namespace diracstep
