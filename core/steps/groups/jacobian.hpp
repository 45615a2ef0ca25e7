#pragma once

#include <diracstep/core/steps/groups/stages.hpp>
#include <vector>

namespace diracstep {

/// The exact Jacobian of the equations of a step GL(s) on a space (step.hpp).
///
/// With δ the derivative by V_l: δy = h/2 b_l, δX_i = α_il, δΞ_i = D_i α_il + δ_il dτ_{X_i}; a configuration
/// moves in the body by Ad_{τ(−X_i)} dτ_y δy + dτ_{X_i} δX_i, and Ad_{τ(x)}ᵀ c by ad*_w of it with w = dτ_x
/// δx.
class GroupJacobian {
 public:
  /// The stages, which outlive this, hold the point it is taken at.
  explicit GroupJacobian(const GroupStages& stages) : stages_(stages), end_rows_(stages.scene) {}

  /// At x, where the stages were evaluated last.
  void take(ConstVectorRef x, ColumnsRef matrix);
  double curvature() const { return curvature_; }  ///< largest entry of ∂²L/∂g²

 private:
  /// Derivatives at all nodes, and those of dτ.
  struct NodeDerivatives {
    GroupPoint::Derivatives of;
    Columns along, momentum_along, force_along, hessian, carried;
    Columns impulse, impulse_along;  ///< at a Lobatto node
  };

  void take_derivatives(ConstVectorRef x);
  Columns motion_of(const GroupNode& node, int l) const;
  void add_velocity_columns(int l, ColumnsRef matrix);
  void add_row_columns(int k, int l, const Columns& values, bool of_holonomic, ColumnsRef matrix);
  void add_multiplier_columns(int j, ColumnsRef matrix);

  const GroupStages& stages_;
  GroupRows end_rows_;
  std::vector<NodeDerivatives> derivatives_;
  std::vector<Columns> lobatto_carried_;
  Columns centre_carried_, ends_along_;
  double curvature_ = 0.0;
};

}  // namespace diracstep
