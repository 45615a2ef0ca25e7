#pragma once

#include <diracstep/core/steps/gauss_lobatto/fixed_stages.hpp>
#include <diracstep/core/steps/gauss_lobatto/points.hpp>
#include <diracstep/core/system/force.hpp>
#include <diracstep/core/system/phase_function.hpp>
#include <memory>
#include <vector>

namespace diracstep {

/// L and the force in a collocation step, GL(s) above all: ∂L/∂q + f and ∂L/∂v at its nodes, and their part
/// of the rows of the momentum in its Jacobian,
///
///   −h² Σ_j â_ij a_jk ∂²L/∂q²_j − h â_ik ∂²L/∂q∂v_k + h a_ik ∂²L/∂v∂q_i + δ_ik ∂²L/∂v²_i
///
/// in row i and column k, with the derivatives of f added to those of ∂L/∂q.
class StageMomentum {
 public:
  /// `dense`: whether the values of the whole Jacobian are few enough to be kept.  No force is null.
  StageMomentum(std::shared_ptr<const Lagrangian> lagrangian, std::shared_ptr<const Force> force, int stages,
                bool dense);

  /// Adds the blocks of the Jacobian to its layout, as its first ones.
  void plan(BlockPattern& layout) const;

  /// ∂L/∂q + f and ∂L/∂v at the nodes, with the stage velocities in x.
  void evaluate(const NodePoints& at, ConstVectorRef x);
  const Columns& forces() const { return lq_; }
  const Columns& momenta() const { return lv_; }

  /// values = their part of the Jacobian; after second_derivatives() at the same x.
  void set_jacobian(const NodePoints& at, const NodeWeights& weights, const BlockPattern& layout,
                    VectorRef& values);
  /// Those of L and of the force at the nodes; false where those of L, a quadratic one, are known and no
  /// force acts.
  bool second_derivatives(const NodePoints& at, ConstVectorRef x);
  /// Those of L at one node alone.
  void second_derivatives(const NodePoints& at, ConstVectorRef x, int stage);
  const Columns& curvatures() const { return lqq_; }      ///< ∂²L/∂q², values
  const Columns& mixed() const { return lqv_; }           ///< ∂²L/∂q∂v, values
  const Columns& force_gradients() const { return fq_; }  ///< ∂f/∂q, values
  /// The largest entry of both in the first so many stages: what forces lose to the round-off of positions.
  double curvature_size(int stages) const;
  double curvature_size() const { return curvature_size(s_); }
  const SparsityPattern& pattern() const { return lagrangian_->pattern(); }  ///< of second derivatives
  auto mass(int stage) const { return lvv_.col(stage); }                     ///< ∂²L/∂v², values

  /// Where its derivatives stand.
  void place(StageArrays& arrays);
  /// Whether the part of L in the Jacobian is the one of the last Jacobian.
  bool jacobian_known(const NodePoints& at);

  /// ∂L/∂q + f and ∂²L/∂q² at the start of the step in place of the first node, to know their size.
  void evaluate_start(double t, ConstVectorRef q0, ConstVectorRef v0);

  /// The second derivatives at the first node, as they are needed for add_sizes().
  void prepare_sizes(const NodePoints& at, ConstVectorRef x);
  /// sizes += those of the terms that make up ∂L/∂v and h (∂L/∂q + f) and may cancel in them, coordinate by
  /// coordinate, for positions q and velocities v: second derivatives times these.
  void add_sizes(double h, const Vector& q, const Vector& v, Vector& sizes) const;

 private:
  bool all_finite() const;
  void add_block(const NodeWeights& weights, const BlockPattern& layout, int i, int k, VectorRef& values);
  void add_force_block(const NodeWeights& weights, const BlockPattern& layout, int i, int k,
                       VectorRef& values);

  std::shared_ptr<const Lagrangian> lagrangian_;
  std::shared_ptr<const Force> force_;
  int s_, n_;
  bool separable_;
  std::vector<int> mirror_;  ///< places of ∂²L/∂v∂q in ∂²L/∂q∂v, where that is not zero
  Columns lq_, lv_;
  Columns lqq_, lqv_, lvv_, fq_, fv_;
  Vector f_, block_, force_block_;
  Vector jacobian_;  ///< the values of the last one, of a quadratic L without force
  double jacobian_step_ = 0.0;
  bool same_jacobian_, hessians_known_ = false;
};

}  // namespace diracstep
