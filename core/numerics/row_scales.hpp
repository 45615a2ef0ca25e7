#pragma once

#include <algorithm>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/numerics/types.hpp>

namespace diracstep {

/// Scales of the rows of a block, for a block of rows whose terms are of very different sizes: of a light
/// oscillator beside a heavy one round-off is that of its own terms.  Rows whose terms are within a factor of
/// 1000 of the scale of their block share that scale.
class RowScales {
 public:
  /// So many rows, the same ones in so many copies.
  explicit RowScales(int rows = 0, int copies = 1)
      : terms(Vector::Zero(rows)), copies_(copies), scales_(Vector::Zero(rows * copies)) {}

  Vector terms;  ///< sizes of the terms of each row

  bool alike(double scale) const {
    for (const double of_row : terms)
      if (!(of_row >= alike_to * scale)) return false;
    return true;
  }

  /// Gives the block scales by row where its own does not fit all of them; `factor` of the terms.
  void give_to(ResidualBlock& block, double factor = 1.0) {
    block.each = nullptr;
    if (alike(block.scale / factor)) return;
    const double least = std::max(smallest_part * block.scale, smallest_scale);
    for (Eigen::Index i = 0; i < terms.size(); ++i) {
      const double own = factor * terms[i];
      set(i, own >= alike_to * block.scale ? block.scale : std::max(least, scale_of(own)));
    }
    block.each = scales_.data();
  }

  /// Terms of a row have turned out to be of such a size.
  void raise(Eigen::Index row, double size) {
    if (scales_[row] < size && std::isfinite(size)) set(row, size);
  }

 private:
  static constexpr double alike_to = 1e-3;
  /// Where the only term of a row has to vanish, as a multiplier of a row without force, it is done here.
  static constexpr double smallest_part = 1e-30;

  void set(Eigen::Index row, double scale) {
    for (Eigen::Index copy = 0; copy < copies_; ++copy) scales_[row + copy * terms.size()] = scale;
  }

  Eigen::Index copies_;
  Vector scales_;
};

}  // namespace diracstep
