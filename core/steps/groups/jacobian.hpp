#pragma once

#include <diracstep/core/steps/groups/stages.hpp>
#include <vector>

namespace diracstep {

/// The exact Jacobian of the equations of a step GL(s) on a space (step.hpp).
///
/// With δ the derivative by V_l: δy = h/2 b_l, δX_i = α_il, δΞ_i = D_i α_il + δ_il dτ_{X_i}; a configuration
/// moves in the body by Ad_{τ(−X_i)} dτ_y δy + dτ_{X_i} δX_i, and Ad_{τ(x)}ᵀ c by ad*_w of it with w = dτ_x
/// δx.
///
/// So every derivative by V_l is of the form h/2 b_l · centre + α_il · chart + δ_il · own, with three
/// matrices for each node that do not depend on l.
template <int D>
class GroupJacobian {
 public:
  using Square = typename GroupSizes<D>::Square;

  /// The stages, which outlive this, hold the point it is taken at.
  explicit GroupJacobian(const GroupStages<D>& stages) : stages_(stages), end_rows_(stages.scene) {}

  /// At x, where the stages were evaluated last.
  void take(ConstVectorRef x, ColumnsRef matrix);
  double curvature() const { return curvature_; }  ///< largest entry of ∂²L/∂g² and ∂f/∂g

 private:
  struct Parts {
    Square centre, chart, own;
  };
  /// Of dτᵀ π, of φ and of Ad_{τ(−X)}ᵀ F at a Gauss node; of dτᵀ c and Ad_{τ(−X)}ᵀ c at a Lobatto node; how
  /// the configuration moves.
  struct NodeParts {
    Parts momentum, phi, force, impulse, impulse_carried;
    Square gauss_motion, lobatto_motion;  ///< Ad_{τ(−X)} dτ_y
  };

  void take_gauss(int i);
  void take_lobatto(ConstVectorRef x, int j);
  Square motion(const GroupNode<D>& node, const Square& by_centre, int l) const {
    return stages_.of_centre(l) * by_centre + node.alpha[l] * node.dtau;
  }
  void add_velocity_columns(int l, ColumnsRef matrix);
  void add_rows(int l, ColumnsRef matrix);
  void add_row_columns(int k, int l, const typename GroupSizes<D>::Rows& values, bool of_holonomic,
                       ColumnsRef matrix);
  void add_multiplier_columns(int j, ColumnsRef matrix);

  const GroupStages<D>& stages_;
  GroupRows<D> end_rows_;
  typename GroupPoint<D>::Derivatives at_node_;
  std::vector<NodeParts> parts_;
  Square centre_carried_, ends_along_;
  double curvature_ = 0.0;
};

}  // namespace diracstep
