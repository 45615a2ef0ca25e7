#pragma once

#include <Eigen/LU>
#include <diracstep/core/numerics/small_lu.hpp>
#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/steps/gauss_lobatto/momentum.hpp>
#include <diracstep/core/steps/gauss_lobatto/rows.hpp>
#include <diracstep/core/steps/gauss_lobatto/stage_sums.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <vector>

namespace diracstep {

/// The Jacobian of the step GL(s) with M = ∂²L/∂v² of one point and the rows of each node as they are, the
/// other terms, of size h, left out:
///
///   M δV_i − Σ_l e_il A(Q~_l)ᵀ δλ_l = r_i,     Σ_k C_jk A_j δV_k = g_j      i = 1…s, j, l = 0…s−1
///
/// with C = 1 and A_j = A(Q_j) for nonholonomic rows, C_jk = a~_{j+1,k} and A_j = A(Q~_{j+1}) for holonomic
/// ones. Solved by
///
///   Σ_l (C e)_jl A_j M⁻¹ A(Q~_l)ᵀ δλ_l = g_j − Σ_k C_jk A_j M⁻¹ r_k
///
/// so only matrices of size n and s m are factored.
class StageSplitting {
 public:
  StageSplitting(const GaussLobattoTableau& table, const std::vector<StageRows>& rows,
                 const Lagrangian& lagrangian);

  /// Takes M in the middle of the step, at the stages that were evaluated last, with the unknowns x, and
  /// gives M⁻¹.
  const Columns& inverse_mass(const StagePoints& at, StageMomentum& momentum, ConstVectorRef x);

  /// Takes M in the middle of the step and A at its nodes, where they were evaluated last, with the unknowns
  /// x.
  void move_to(const StagePoints& at, StageMomentum& momentum, std::vector<StageRows>& rows,
               ConstVectorRef x);

  /// f = (r, g), stage by stage, is replaced by (δV, δλ).
  void solve(VectorRef& f);

 private:
  /// The rows of one block: how those of its nodes are weighted.
  struct Block {
    int first, rows;
    bool holonomic;
    Columns response;  ///< C e
  };

  void take_mass(const StagePoints& at, StageMomentum& momentum, ConstVectorRef x);
  void set_mass(const SparsityPattern& pattern, ConstVectorRef values);
  void factor_rows();
  void solve_mass(double* column);
  void sum_stages(const double* x, const Columns& weights, const double* base, double* y) const;
  double dot(const double* a, const double* b) const;

  int s_, n_, m_;
  bool mass_constant_, mass_known_ = false;
  StageSum sum_;
  Columns impulse_weights_;     ///< e_il, column i
  Columns constraint_weights_;  ///< a~_{j+1,k}, column j
  std::vector<Block> blocks_;
  Columns mass_, inverse_;
  bool diagonal_ = false;
  Vector inverse_mass_;  ///< where M is diagonal
  Vector solution_;
  Eigen::PartialPivLU<Columns> mass_factors_;
  Columns forms_;         ///< rows of A_j as columns, that of row a at j m + a
  Columns through_mass_;  ///< M⁻¹ A(Q~_l)ᵀ, likewise
  Columns response_;      ///< the matrix of the multipliers
  SmallLu<0> response_factors_;
  bool regular_ = true;  ///< the last response
  Columns mixed_, impulses_;
};

}  // namespace diracstep
