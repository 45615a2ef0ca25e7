#pragma once

#include <diracstep/core/steps/gauss_lobatto/momentum.hpp>
#include <diracstep/core/steps/gauss_lobatto/points.hpp>
#include <diracstep/core/steps/radau/tableau.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/scene.hpp>
#include <optional>
#include <vector>

namespace diracstep {

/// The rows of a scene in a step of Radau IIA: A(Q_i) V_i + b = 0 at its nodes, φ(Q_i)/h = 0 where they are
/// holonomic, and the projection h A_h(q0)ᵀ w_i that keeps the latter.
///
/// Unknowns x = (V, λ, w), residual f = (momentum, velocity rows, position rows), each with a column for each
/// stage.
class RadauRows {
 public:
  RadauRows(const Scene& scene, const RadauTableau& table);

  int rows() const { return m_; }
  int holonomic_rows() const { return projection_.rows(); }

  /// Adds the blocks of the Jacobian; `momentum` has those of L and the force.
  void plan(BlockPattern& layout, const StageMomentum& momentum, const Force* force);

  /// A and A_h at the start.
  void begin(double t, ConstVectorRef q0);
  /// Q_i += h A_h(q0)ᵀ w_i.
  void project(const double* x, NodePoints& at) const;
  /// A, b and φ at the nodes; impulses(i) = A(Q_i)ᵀ λ_i.
  void evaluate(const NodePoints& at, const double* x, Columns& impulses);
  void residual(const NodePoints& at, const double* x, double* f) const;
  void add_to_jacobian(const NodePoints& at, const double* x, const StageMomentum& momentum,
                       const BlockPattern& layout, VectorRef& values);

  /// The largest entry of A at the start.
  double form_size_at_start() const;
  /// The largest entries of A at the nodes; of A λ; of ∂(Aᵀλ)/∂q after add_to_jacobian().
  double form_size() const;
  double impulse_size(const double* multipliers) const;
  double curvature_size() const;
  /// The largest term of ∂b/∂q q, the derivative at the start and q at the end: what b cancels inside, as
  /// (told - x)/lag, it loses to the round-off of positions.  A thousandth of it counts as a scale.
  double rate_size(const Columns& q) const;
  /// sizes += those of the terms of Aᵀλ and of what it loses to the round-off of positions.
  void add_impulse_sizes(const double* x, const Vector& q, Vector& sizes) const;
  /// sizes = those of the terms of A v + b.
  void size_velocity_terms(const Vector& v, Vector& sizes) const;
  /// sizes = those of A_h q.
  void size_position_terms(const Vector& q, Vector& sizes) const;

 private:
  struct Block {
    Block(std::shared_ptr<const ConstraintRows> rows, int stages, int first_row, int first_position);

    std::shared_ptr<const ConstraintRows> rows;
    int first, first_position;  ///< among all rows, among the holonomic ones
    Columns a, b, derivative, curvature, positions, multipliers;
    PatternProduct derivative_along, curvature_along, positions_along;  ///< times A_hᵀ
    int layout = -1;
  };

  int velocity_row(const Block& block, int i) const { return n_ * s_ + m_ * i + block.first; }
  int position_row(const Block& block, int i) const {
    return (n_ + m_) * s_ + holonomic_rows() * i + block.first_position;
  }
  int projection_column(int i) const { return (n_ + m_) * s_ + holonomic_rows() * i; }

  void plan(Block& block, BlockPattern& layout);
  void second_derivatives(const NodePoints& at, const double* x, Block& block);
  void add_rows(const NodePoints& at, Block& block, const BlockPattern& layout, VectorRef& values);
  void add_projection(double h, Block& block, const BlockPattern& layout, VectorRef& values);
  void add_product(const PatternProduct& product, const double* left, double factor,
                   const BlockPattern& layout, int number, VectorRef& values);

  int s_, n_, m_;
  Columns table_;
  std::vector<Block> blocks_;
  ConstraintsAtPoint start_, projection_;  ///< A(q0) and A_h(q0)
  PatternProduct stiffness_along_, mixed_along_, force_along_;
  int lagrangian_layout_ = -1, force_layout_ = -1;
  Vector start_rates_;    ///< ∂b/∂q there
  Vector product_, sum_;  ///< workspaces
};

}  // namespace diracstep
