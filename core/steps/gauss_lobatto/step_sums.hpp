#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/steps/gauss_lobatto/compensated_sums.hpp>
#include <diracstep/core/steps/gauss_lobatto/points.hpp>
#include <diracstep/core/steps/gauss_lobatto/stage_sums.hpp>
#include <diracstep/core/steps/state.hpp>
#include <optional>

namespace diracstep {

/// What the sums of a step take of its nodes, a column for each: momenta and forces ∂L/∂q + f at the Gauss
/// nodes, impulses Aᵀλ_j at the Lobatto nodes before the last.
struct StageColumns {
  const Columns& momenta;
  const Columns& forces;
  const Columns& impulses;
};

/// The sums over the stages of a step GL(s): positions, rows of the momentum and the end; in extended
/// precision where that is asked for, of few coordinates by functions for their number, of many piece by
/// piece.
class StepSums {
 public:
  /// With m rows; without any, nothing looks at the Lobatto nodes inside the step.
  StepSums(int stages, int dimension, int rows);

  /// From now on in extended precision.
  void compensate() { compensated_.emplace(s_, n_); }
  bool compensated() const { return compensated_.has_value(); }
  void begin(const State& start) {
    if (compensated_) compensated_->begin(start.rest);
  }

  /// q0 + h Σ_k a_ik V_k at the Gauss nodes, and so at the Lobatto nodes behind the first.
  void move(StagePoints& points, ConstVectorRef x);
  /// ∂L/∂v − p0 − h Σ_j â_ij ∂L/∂q_j − Σ_j e_ij Aᵀλ_j, the first rows of f.
  void momentum_rows(const StagePoints& points, const StageColumns& stages, const Vector& p0, VectorRef& f);
  /// q1 and p1.
  void end(const StagePoints& points, const StageColumns& stages, const Vector& p0, ConstVectorRef x,
           StepEnd& end);

 private:
  void long_momentum_row(const StagePoints& points, const StageColumns& stages, const Vector& p0, int i,
                         double* row) const;
  Eigen::Map<const Columns> velocities(ConstVectorRef x) const { return {x.data(), n_, s_}; }

  int s_, n_, m_;
  StageSum sum_;  ///< null for long columns
  std::optional<CompensatedSums> compensated_;
};

}  // namespace diracstep
