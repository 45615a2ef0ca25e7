#pragma once

#include <algorithm>
#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/steps/groups/point.hpp>
#include <diracstep/core/steps/state.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// A node of a step in the chart around its middle: X = Σ_l α_l V_l.
template <int D>
struct GroupNode {
  using Column = typename GroupSizes<D>::Column;
  using Square = typename GroupSizes<D>::Square;

  double t = 0.0;
  Vector alpha;                                   ///< s
  Column x;                                       ///< X
  Vector q;                                       ///< g_c τ(X)
  Square adjoint, adjoint_back, dtau, dtau_back;  ///< Ad_{τ(X)}, Ad_{τ(−X)}, dτ_X, dτ_{−X}
  Square along;                                   ///< ∂(dτ_X V)/∂X, at a Gauss node
  Column carried;                                 ///< Ad_{τ(−X)}ᵀ of the force or the impulse there

  void place(const Space& space, const typename GroupSizes<D>::Stages& v);
  /// The maps above at x.
  void take_maps(const Space& space);
};

/// What the equations of a step GL(s) on a space are made of (step.hpp), at the unknowns x last evaluated.
template <int D>
class GroupStages {
 public:
  using Column = typename GroupSizes<D>::Column;
  using Square = typename GroupSizes<D>::Square;
  using Stages = typename GroupSizes<D>::Stages;

  GroupStages(int s, const Scene& scene);

  void begin(Interval of, const State& start);
  /// False where the step leaves what the retraction is injective on; `failure` then says so.
  bool evaluate(ConstVectorRef x);

  bool holonomic(int r) const { return rows_at_start.holonomic()[at(r)]; }
  bool has_holonomic() const { return has(true); }
  bool has_nonholonomic() const { return has(false); }
  /// Of φ_i and of dτᵀ c_j in the equation of stage k; of V_l in y.
  double gauss_weight(int i, int k) const {
    return step.size * table.b[i] / table.b[k] * (table.a(i, k) - 0.5 * table.b[k]);
  }
  double lobatto_weight(int j, int k) const {
    return table.lobatto_b[j] / table.b[k] * (table.lobatto_a(j, k) - 0.5 * table.b[k]);
  }
  double of_centre(int l) const { return 0.5 * step.size * table.b[l]; }
  Eigen::VectorBlock<const Eigen::Ref<const Vector>> multipliers(ConstVectorRef x, int j) const {
    return x.segment(n * s + m * j, m);
  }
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  const Scene& scene;
  const Space& space;
  const int s, n, m;
  const GaussLobattoTableau table;
  const bool reduced;  ///< nothing depends on the configuration
  GroupRows<D> rows_at_start;
  std::vector<GroupNode<D>> gauss, lobatto;
  std::vector<GroupPoint<D>> points;           ///< at the Gauss nodes
  std::vector<GroupRows<D>> rows, gauss_rows;  ///< at the Lobatto and at the Gauss nodes
  Interval step{};
  Vector q0, g_c;
  Column p0, middle_momentum;           ///< the last one is M
  GroupNode<D> centre;                  ///< its x is y
  Stages v, xi, phi, forces, impulses;  ///< a column for each node
  std::string failure;                  ///< of any evaluation since another start was given
  /// Sizes of terms, at least those of the step before where it was told them.
  double force_size = 0.0, impulse_size = 0.0, momentum_size = 0.0, velocity_size = 0.0, form_size = 0.0;

 private:
  bool has(bool holonomic_ones) const {
    return std::ranges::find(rows_at_start.holonomic(), holonomic_ones) != rows_at_start.holonomic().end();
  }
  void set_node(GroupNode<D>& node, double c, const Vector& a);
  void place_nodes();
  void move_to(GroupNode<D>& node);
  void add_forces();
  void add_rows(ConstVectorRef x);

  Vector last_x_;
  bool evaluated_ = false, inside_ = true;  ///< at last_x_
};

}  // namespace diracstep
