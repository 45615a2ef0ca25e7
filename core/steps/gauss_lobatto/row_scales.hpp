#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/numerics/row_scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/momentum.hpp>
#include <diracstep/core/steps/gauss_lobatto/points.hpp>
#include <diracstep/core/steps/gauss_lobatto/rows.hpp>
#include <diracstep/core/system/scene.hpp>
#include <span>
#include <vector>

namespace diracstep {

/// Scales of the single rows of a step GL(s), see RowScales.
///
/// Terms of a row of the momentum: p0, ∂L/∂v and h (∂L/∂q + f) with the terms that cancel in them, the
/// impulses Aᵀλ and what these lose to round-off of positions.  Terms of a row of the constraint: A times the
/// velocities and times positions over h.
class StageRowScales {
 public:
  StageRowScales(int stages, const Scene& scene);

  /// Where the residual was last taken, with the unknowns x.
  struct Point {
    const StagePoints& at;
    StageMomentum& momentum;
    std::vector<StageRows>& rows;
    const Vector& p0;
    const Vector& x;
  };
  /// As NonlinearProblem::scales_of_unsolved_rows(); `part` of the terms counts.
  const double* unsolved(const Point& point, ConstVectorRef f, double level,
                         std::span<const ResidualBlock> blocks, double part) {
    if (beside_known_terms(point, f.data(), part * level)) return nullptr;
    return beside_all_terms(point, f, level, blocks, part);
  }

 private:
  /// Whether all rows are small beside momenta and single terms of the constraint.
  bool beside_known_terms(const Point& point, const double* f, double level) const {
    bool all = true;
    for (int i = 0; i < s_; ++i) all &= RowScales::solved(f + n_ * i, point.p0.data(), n_, level);
    for (const StageRows& rows : point.rows)
      all &= rows.bound(point.at, point.x.data(), f, RowScales::margin * level);
    return all;
  }
  const double* beside_all_terms(const Point& point, ConstVectorRef f, double level,
                                 std::span<const ResidualBlock> blocks, double part);

  int s_, n_, m_;
  bool quadratic_;  ///< L without force
  double length_;   ///< of the rows
  Vector tolerances_;
  RowScales scales_;
  Vector q_, v_, largest_q_, largest_v_;  ///< sizes of positions and velocities, own and the largest
  Vector momenta_, largest_momenta_, rows_, largest_rows_;
};

}  // namespace diracstep
