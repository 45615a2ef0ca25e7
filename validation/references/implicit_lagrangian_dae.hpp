#pragma once

#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/system/scene.hpp>
#include <diracstep/validation/references/continuous_dae.hpp>
#include <diracstep/validation/references/reference_run.hpp>
#include <memory>
#include <vector>

namespace diracstep {

/// The continuous implicit Lagrangian system (Leok and Ohsawa (4.7)) as F(t, y, ẏ) = 0 with y = (q, v, p, Λ,
/// M), in the formulation `rates` with multipliers as derivatives (index 1):
///
///   q̇ − v − A_holᵀ Ṁ = 0,   ṗ − ∂L/∂q − f − Aᵀ Λ̇ = 0,   p − ∂L/∂v = 0,   A v + b = 0,   φ = 0
///
/// where Λ̇ are the forces of all rows and Ṁ, present for holonomic rows only, keeps φ = 0 (stabilisation of
/// Gear, Gupta and Leimkuhler).  In `index_2` Λ and M stand in place of Λ̇ and Ṁ; `velocity` is without M and
/// φ = 0.  In R^n only; on groups and spheres there is group_lagrangian_dae.hpp.
class ImplicitLagrangianDae final : public ContinuousDae {
 public:
  /// With `dense` the Jacobian is a full matrix.
  ImplicitLagrangianDae(const Scene& scene, bool dense, DaeFormulation formulation = DaeFormulation::rates);

  int size() const override { return size_; }
  const SparsityPattern& pattern() const override { return pattern_; }
  void residual(double t, ConstVectorRef y, ConstVectorRef rate, VectorRef f) override;
  void jacobian(double t, double cj, ConstVectorRef y, ConstVectorRef rate, VectorRef values) override;

 private:
  /// A block of rows, the places of its Λ and M among the unknowns, and its values at the last point.
  struct Rows {
    std::shared_ptr<const ConstraintRows> rows;
    bool stabilised;  ///< φ = 0 and M are there
    int force, drift;
    Vector a, b, derivative, force_derivative, drift_derivative;
  };

  template <class Visit>
  void for_each_block(double cj, Visit visit);

  std::shared_ptr<const Lagrangian> lagrangian_;
  std::shared_ptr<const Force> force_;  ///< may be null
  DaeFormulation formulation_;
  int n_;
  int size_;
  std::vector<Rows> rows_;
  BlockPattern layout_;
  SparsityPattern pattern_, diagonal_;
  Vector ones_, lq_, lv_, lqq_, lqv_, lvv_, f_, fq_, fv_;
};

}  // namespace diracstep
