#pragma once

#include <Eigen/LU>
#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <vector>

namespace diracstep {

/// The Jacobian of the step GL(s) with M = ∂²L/∂v² and A taken at one point and the other terms, of size h,
/// left out:
///
///   M δV_i − Σ_j e_ij Aᵀ δλ_j = r_i,     Σ_k C_jk A δV_k = g_j      i = 1…s, j = 0…s−1
///
/// with C = 1 for nonholonomic rows and C_jk = a~_{j+1,k} for holonomic ones.  Solved by
/// (C e ⊗ A M⁻¹ Aᵀ) δλ = g − C A M⁻¹ r, so only matrices of size n, m and s are factored.
class StageSplitting {
 public:
  StageSplitting(const GaussLobattoTableau& table, int n, int m, bool holonomic);

  /// Puts values of M on its pattern in place and factors it.
  void set_mass(const SparsityPattern& pattern, ConstVectorRef values);
  /// Puts the values of some rows of A in place, `first` being the first of them.
  void set_rows(int first, const SparsityPattern& pattern, ConstVectorRef values);
  /// Factors A M⁻¹ Aᵀ once all rows are set.
  void factor_rows();

  /// f = (r, g), stage by stage, is replaced by (δV, δλ).
  void solve(VectorRef& f);

 private:
  int s_, n_, m_;
  Columns impulse_weights_;     ///< e_ij, s×s
  Columns constraint_weights_;  ///< C
  Columns unmix_;               ///< (C e)⁻¹
  Columns mass_, rows_, response_;
  bool diagonal_ = false;
  Vector inverse_mass_;  ///< where M is diagonal
  Vector solution_;
  Eigen::PartialPivLU<Columns> mass_factors_, response_factors_;
  Columns through_mass_;  ///< M⁻¹ Aᵀ
  Columns velocities_, gaps_, impulses_, forces_;

  void solve_mass(Columns& columns);
};

}  // namespace diracstep
