#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/numerics/row_scales.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <vector>

namespace diracstep {

/// Unknowns (q, ν):   q − q̂ + Dφ(q)ᵀν = 0,   φ(t,q) = 0: the nearest point of the constraint, full matrices.
/// Of coordinates that are held the first equation is q = q̂.
class NearestPointProblem final : public NonlinearProblem {
 public:
  NearestPointProblem(ConstraintBlocks blocks, double t, const Vector& given, std::vector<int> held);

  int size() const override { return n_ + m_; }
  const SparsityPattern& pattern() const override { return pattern_; }
  std::span<const ResidualBlock> blocks() const override { return residual_blocks_; }

  void residual(ConstVectorRef x, VectorRef f) override;
  const double* scales_of_unsolved_rows(ConstVectorRef f, double level) override;
  void jacobian(ConstVectorRef x, VectorRef values) override;

 private:
  void raise_scales(ConstVectorRef x);

  ConstraintBlocks blocks_;
  std::vector<int> held_;
  ConstraintsAtPoint rows_;
  double t_;
  Vector given_;
  int n_, m_;
  SparsityPattern pattern_;
  std::vector<ResidualBlock> residual_blocks_;
  RowScales row_scales_;
  Vector row_sizes_;
};

}  // namespace diracstep
