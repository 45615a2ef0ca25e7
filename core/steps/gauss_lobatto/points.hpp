#pragma once

#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/system/point_columns.hpp>

namespace diracstep {

/// The weights of the positions and of the forces at the nodes of a collocation step of size h.  One column
/// for each sum over stages, so that the weights of a sum stand side by side.
struct NodeWeights {
  /// Scales to a step size.
  void scale(double h, const Columns& a, const Columns& a_hat);

  Columns position;   ///< h a_ik, column i
  Columns force;      ///< −h â_ij, column i
  Columns stiffness;  ///< −h² â_ij a_jk over j, column i s + k
};

/// The tableau of GL(s) times what it comes with in a step of size h.
class StageWeights : public NodeWeights {
 public:
  explicit StageWeights(int stages);

  /// Scales to another step size.
  void scale_to(double h);

  GaussLobattoTableau table;
  Columns lobatto;        ///< h a~_jk, column j
  Columns impulse;        ///< −e_ij for j < s, column i
  Columns row_curvature;  ///< −h e_ij a~_jk over j < s, column i s + k
  Vector end_force;       ///< h b_j

 private:
  double step_ = 0.0;
};

/// The configurations of a step at the nodes where L and the forces are taken: those of Gauss in GL(s).
struct NodePoints {
  NodePoints(int stages, int dimension);

  double gauss_time(int i) const { return gauss_times[i]; }
  /// These nodes, with what else is given there.
  PointColumns at_gauss(const double* y = nullptr) const {
    return {static_cast<int>(gauss.cols()), gauss_times.data(), gauss.data(), y};
  }

  Interval step{0.0, 1.0};
  Vector gauss_times;
  Columns gauss;  ///< Q_i, i = 1 … s
};

/// The configurations of a step GL(s) at its nodes.
struct StagePoints : NodePoints {
  StagePoints(int stages, int dimension);

  /// The times and the weights of this step.
  void begin(Interval interval);

  double lobatto_time(int j) const { return lobatto_times[j]; }
  /// `count` Lobatto nodes from `first` on.
  PointColumns at_lobatto(int first, int count) const {
    return {count, lobatto_times.data() + first, lobatto.data() + lobatto.rows() * first};
  }

  StageWeights weights;
  Vector lobatto_times;
  Columns lobatto;  ///< Q~_j, j = 0 … s, the first of them q0
};

}  // namespace diracstep
