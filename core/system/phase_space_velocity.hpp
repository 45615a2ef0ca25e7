#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/numerics/row_scales.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <vector>

namespace diracstep {

/// Unknown v, linear:   ∂L/∂q(t,q,v) = Dθ(t,q) v + ∂θ/∂t,  that is (Dθᵀ − Dθ) v = ∂H/∂q + ∂θ/∂t: the velocity
/// of a phase-space Lagrangian θ(t,q)·v − H(t,q). Regular where the two-form dθ is.
class PhaseSpaceVelocityProblem final : public NonlinearProblem {
 public:
  PhaseSpaceVelocityProblem(const Scene& scene, bool dense);

  int size() const override { return lagrangian_->dimension(); }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return blocks_; }

  void begin(double t, ConstVectorRef q);
  void residual(ConstVectorRef v, VectorRef f) override;
  void jacobian(ConstVectorRef v, VectorRef values) override;
  const double* scales_of_unsolved_rows(ConstVectorRef f, double level) override;

 private:
  std::shared_ptr<const Lagrangian> lagrangian_;
  std::vector<int> mirror_;
  SparsityPattern pattern_;
  BlockPattern layout_;
  std::vector<ResidualBlock> blocks_;
  RowScales row_scales_{lagrangian_->dimension()};
  double t_ = 0.0;
  Vector q_, lq_, lv_, lvt_, lqq_, lqv_, lvv_, sizes_, largest_;
};

}  // namespace diracstep
