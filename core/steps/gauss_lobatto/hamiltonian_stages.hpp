#pragma once

#include <diracstep/core/steps/gauss_lobatto/points.hpp>
#include <diracstep/core/system/force.hpp>
#include <diracstep/core/system/phase_function.hpp>
#include <memory>
#include <vector>

namespace diracstep {

/// H and the force at the Gauss nodes of a step with unknown stage velocities V_i and momenta P_i, and their
/// part of its Jacobian: with F = −∂H/∂q + f, in the rows of the momentum i and of the velocity i
///
///   by V_k   −h² Σ_j â_ij a_jk ∂F/∂q_j − h â_ik ∂f/∂v_k         δ_ik − h a_ik ∂²H/∂p∂q_i
///   by P_k   δ_ik + h â_ik ∂²H/∂q∂p_k                           −δ_ik ∂²H/∂p²_i
class HamiltonianStages {
 public:
  /// No force is null.
  HamiltonianStages(std::shared_ptr<const Hamiltonian> hamiltonian, std::shared_ptr<const Force> force,
                    int stages);

  /// Adds the blocks of the Jacobian to its layout, as its first ones.
  void plan(BlockPattern& layout);

  /// F, ∂H/∂p and P at the nodes, with V_1 … V_s, P_1 … P_s at the head of x.
  void evaluate(const NodePoints& at, ConstVectorRef x);
  const Columns& forces() const { return forces_; }
  const Columns& velocities() const { return hp_; }
  const Columns& momenta() const { return p_; }

  /// values = their part of the Jacobian; after evaluate() at the same x.
  void set_jacobian(const NodePoints& at, const NodeWeights& weights, const BlockPattern& layout,
                    ConstVectorRef x, VectorRef& values);

  /// First and second derivatives at the start in place of the first node, to know their size.
  void evaluate_start(double t, ConstVectorRef q0, ConstVectorRef p0, ConstVectorRef v0);
  /// Second derivatives at the first node, as they are needed for add_sizes().
  void prepare_sizes(const NodePoints& at);
  /// The largest of ∂²H/∂q², ∂²H/∂q∂p and ∂²H/∂p² as they were last taken.
  struct Largest {
    double qq, qp, pp;
  };
  Largest largest() const;
  /// Adds the sizes of the terms that may cancel in h F and in ∂H/∂p, coordinate by coordinate, for positions
  /// q and momenta p: second derivatives times these.
  void add_sizes(double h, const Vector& q, const Vector& p, Vector& momenta, Vector& velocities) const;

 private:
  void add_blocks(const NodeWeights& weights, const BlockPattern& layout, int i, int k, VectorRef& values);
  void add_force(const NodeWeights& weights, const BlockPattern& layout, int i, int k, VectorRef& values);

  std::shared_ptr<const Hamiltonian> hamiltonian_;
  std::shared_ptr<const Force> force_;
  int s_, n_;
  bool separable_;
  std::vector<int> mirror_;
  Columns p_, forces_, hp_, hqq_, hqp_, hpp_, fq_, fv_;
  Vector f_, block_, force_block_;
  int mixed_layout_ = -1, diagonal_layout_ = -1, force_layout_ = -1;
};

}  // namespace diracstep
