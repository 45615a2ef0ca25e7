#pragma once

#include <diracstep/core/spaces/space.hpp>
#include <diracstep/validation/references/continuous_dae.hpp>

namespace diracstep {

/// The continuous implicit Lagrangian system on a configuration space of groups and spheres,
/// left-trivialised: increments multiply from the right, velocities and momenta are in the body.  SUNDIALS
/// knows no groups, so that the unknowns hold the N = Space::storage_size() stored numbers q of a
/// configuration, which move by g' = g ξ.  With B = d(q τ(x))/dx at x = 0, N×n, in the formulation `rates`
///
///   q̇ − B (v + A_holᵀ Ṁ) = 0,   ṗ − ad*_v p − F − f − Aᵀ Λ̇ = 0,   p − ∂L/∂v = 0,   A v + b = 0,   φ = 0
///
/// with F the derivative of L along the space, f the force; the other formulations as in
/// implicit_lagrangian_dae.hpp.  Nothing holds q on the space: quaternions leave norm 1 by the tolerance of
/// the integration, see ReferenceRun::off_space.  The Jacobian is a full matrix; its derivatives by q are
/// those along the space, with B⁺ behind them, and differences of the residual across it.  O. Brüls, A.
/// Cardona, J. Comput. Nonlinear Dynam. 5 (2010) for the equations.
class GroupLagrangianDae final : public ContinuousDae {
 public:
  /// The scene must have a space and outlive this.
  explicit GroupLagrangianDae(const Scene& scene, DaeFormulation formulation = DaeFormulation::rates);

  int size() const override { return size_; }
  const SparsityPattern& pattern() const override { return pattern_; }
  void residual(double t, ConstVectorRef y, ConstVectorRef rate, VectorRef f) override;
  void jacobian(double t, double cj, ConstVectorRef y, ConstVectorRef rate, VectorRef values) override;

 private:
  /// v + A_holᵀ M, the velocity that moves q.
  Vector moving_velocity(double t, ConstVectorRef y, ConstVectorRef multipliers) const;
  void add_across(double t, ConstVectorRef y, ConstVectorRef rate, const Columns& basis, VectorRef values);
  ConstVectorRef multipliers(ConstVectorRef y, ConstVectorRef rate) const;

  const Scene& scene_;
  const Space& space_;
  DaeFormulation formulation_;
  Eigen::Index numbers_, n_, force_, drift_;  ///< sizes of q and v, and where Λ and M begin
  int size_;
  SparsityPattern pattern_;
};

}  // namespace diracstep
