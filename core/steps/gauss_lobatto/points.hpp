#pragma once

#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>

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

  double gauss_time(int i) const { return step.start + weights.table.c[i] * step.size; }
  double lobatto_time(int j) const { return step.start + weights.table.lobatto_c[j] * step.size; }

  StageWeights weights;
  Interval step{0.0, 1.0};
  Columns gauss;    ///< Q_i, i = 1 … s
  Columns lobatto;  ///< Q~_j, j = 0 … s, the first of them q0
};

}  // namespace diracstep
