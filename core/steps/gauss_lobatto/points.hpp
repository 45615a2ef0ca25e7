#pragma once

#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/system/point_columns.hpp>

namespace diracstep {

/// The tableau of GL(s) times what it comes with in a step of size h.  One column for each sum over stages,
/// so that the weights of a sum stand side by side.
class StageWeights {
 public:
  explicit StageWeights(int stages);

  /// Scales to another step size.
  void scale_to(double h);

  GaussLobattoTableau table;
  Columns position;       ///< h a_ik, column i
  Columns lobatto;        ///< h a~_jk, column j
  Columns force;          ///< −h â_ij, column i
  Columns impulse;        ///< −e_ij for j < s, column i
  Columns stiffness;      ///< −h² â_ij a_jk over j, column i s + k
  Columns row_curvature;  ///< −h e_ij a~_jk over j < s, column i s + k
  Vector end_force;       ///< h b_j

 private:
  double step_ = 0.0;
};

/// The configurations of a step GL(s) at its nodes.
struct StagePoints {
  StagePoints(int stages, int dimension);

  /// The times and the weights of this step.
  void begin(Interval interval);

  double gauss_time(int i) const { return gauss_times[i]; }
  double lobatto_time(int j) const { return lobatto_times[j]; }
  /// The Gauss nodes, with what else is given there; `count` Lobatto nodes from `first` on.
  PointColumns at_gauss(const double* y = nullptr) const {
    return {static_cast<int>(gauss.cols()), gauss_times.data(), gauss.data(), y};
  }
  PointColumns at_lobatto(int first, int count) const {
    return {count, lobatto_times.data() + first, lobatto.data() + lobatto.rows() * first};
  }

  StageWeights weights;
  Interval step{0.0, 1.0};
  Vector gauss_times, lobatto_times;
  Columns gauss;    ///< Q_i, i = 1 … s
  Columns lobatto;  ///< Q~_j, j = 0 … s, the first of them q0
};

}  // namespace diracstep
