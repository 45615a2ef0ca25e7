#pragma once

#include <diracstep/core/integrator/solved_stage.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/sensitivities/detail/extended_scene.hpp>
#include <memory>
#include <vector>

namespace diracstep::sensitivity {

/// Products with the transposes of G_x, G_z and F_z of a step GL(s) at its solution, term by term from the
/// derivatives of L, of the force and of the rows at its points: the way back needs no matrix of them.
class GaussLobattoProducts {
 public:
  GaussLobattoProducts(std::shared_ptr<ExtendedScene> scene, int s);

  void take(const SolvedStage& at);
  /// G_xᵀ z̄1   and   G_zᵀ z̄1 − F_zᵀ w, column by column.
  Columns end_by_unknowns(const Columns& end) const;
  Columns by_start(const Columns& end, const Columns& w) const;

 private:
  /// Values on the patterns of L and of the force, at (Q_i, V_i).
  struct Node {
    Vector qq, qv, vv, force_by_point, force_by_velocity;
  };
  /// Values on the patterns of a block of rows, a column for each of the Lobatto points, or nodes.
  struct RowsAt {
    const ConstraintRows* rows;
    int first;
    Columns a, curvature, derivative;
  };

  void take_rows(RowsAt& at, const SolvedStage& stage) const;
  Vector padded(ConstVectorRef column) const;
  /// sum += (∂(L_q + f)/∂X)ᵀ y, y with N numbers.
  void add_by_point(const Node& node, const Vector& y, double* sum) const;
  int row(int j, const RowsAt& at) const { return n_ * s_ + m_ * j + at.first; }

  std::shared_ptr<ExtendedScene> scene_;
  int s_, n_, size_, m_;
  GaussLobattoTableau table_;
  double h_ = 0.0;
  std::vector<Node> nodes_;
  std::vector<RowsAt> rows_;
};

}  // namespace diracstep::sensitivity
