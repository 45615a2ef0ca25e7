#pragma once

#include <diracstep/core/numerics/row_scales.hpp>
#include <diracstep/core/steps/gauss_lobatto/fixed_stages.hpp>
#include <diracstep/core/steps/gauss_lobatto/points.hpp>
#include <diracstep/core/system/constraint_rows.hpp>
#include <memory>
#include <vector>

namespace diracstep {

/// One block of constraint rows in the step GL(s): at the nodes of the step, in its residual and in its
/// Jacobian.  Holonomic rows stand at the Lobatto nodes, φ(Q~_j)/h, nonholonomic ones at the Gauss nodes,
/// A(Q_j) V_j + b; both let impulses Aᵀλ_j in at the Lobatto nodes before the last.
class StageRows {
 public:
  /// In the system of the step these rows at stage j are number first + j · stride and following, and so are
  /// their multipliers among the unknowns; the velocities of all stages come before.
  StageRows(std::shared_ptr<const ConstraintRows> rows, int stages, int first, int stride);

  /// Adds the blocks of the Jacobian to its layout.
  void plan(BlockPattern& layout);

  /// The rows at the start of the step.
  void begin(const StagePoints& at) { evaluate_lobatto(at, 0, 1); }
  /// impulses += A(Q~_j)ᵀ λ_j, column j, with the multipliers in x.
  void add_impulses(const StagePoints& at, ConstVectorRef x, Columns& impulses);
  /// Their rows of f.
  void residual(const StagePoints& at, ConstVectorRef x, VectorRef& f);
  /// Their rows and columns of the Jacobian, and the curvature ∂(Aᵀλ)/∂q in the rows of the momentum; after
  /// add_impulses() at the same x.
  void add_to_jacobian(const StagePoints& at, const BlockPattern& layout, ConstVectorRef x,
                       VectorRef& values);

  /// Where it keeps what it evaluates.
  void place(StageArrays& arrays);
  /// Whether A at the Gauss nodes was evaluated for the last point, by whoever works on those arrays.
  void set_gauss_known(bool known) { gauss_known_ = known; }
  /// All that the Jacobian takes beside what the residual at the same x has evaluated.
  void second_derivatives(const StagePoints& at, ConstVectorRef x);
  /// Evaluates A where the constraint stands, as far as the residual at the same x has not.
  void evaluate_constraint(const StagePoints& at);
  /// A where row j of the constraint stands, values: at Gauss node j, or at Lobatto node j + 1.
  auto constraint(int j) const { return rows_->holonomic() ? at_lobatto_.col(j + 1) : at_gauss_.col(j); }
  /// A at Lobatto node j, values.
  auto lobatto(int j) const { return at_lobatto_.col(j); }
  const ConstraintRows& rows() const { return *rows_; }
  int first() const { return first_ - n_ * s_; }  ///< among the rows of the scene

  /// Size of A(q0).
  double form_size() const;
  /// Size of the impulses of these multipliers, those of all rows of the scene.
  double impulse_size(ConstVectorRef multipliers) const;
  /// Size of the curvature when the Jacobian was last taken.
  double curvature_size() const;
  /// sizes += those of the terms of A(q0)ᵀλ at all stages, coordinate by coordinate, and of what they lose to
  /// round-off of positions of this size.
  void add_impulse_sizes(const StagePoints& at, ConstVectorRef x, const Vector& q, Vector& sizes);
  /// Whether these rows of f are at most `allowed` times a term of theirs, A(q0) times positions over h and
  /// velocities, at all stages.
  bool bound(const StagePoints& at, const double* x, const double* f, double allowed) const {
    const double per_step = 1.0 / std::abs(at.step.size);
    return leading_.bound(f + first_, s_, stride_, allowed, [&](Eigen::Index e, int c) {
      return std::abs(at_lobatto_(e, 0)) * (per_step * std::abs(at.lobatto(c, 0)) + std::abs(x[c]));
    });
  }
  /// sizes = those of the terms of these rows, among those of all rows of the scene, for positions and
  /// velocities of these sizes.
  void size_terms(double h, const Vector& q, const Vector& v, Vector& sizes);

 private:
  /// Of the curvature; empty for one stage, whose only impulse enters at the start and so has none.
  const SparsityPattern& curvature_pattern() const;
  void evaluate_lobatto(const StagePoints& at, int first, int count);
  void add_constraint(const StagePoints& at, const BlockPattern& layout, int j, VectorRef& values);

  std::shared_ptr<const ConstraintRows> rows_;
  int s_, n_, first_, stride_;
  Columns at_lobatto_, at_gauss_;  ///< A at the nodes; at the Gauss nodes nonholonomic rows only
  Columns curvature_;              ///< ∂(Aᵀλ_j)/∂q at the Lobatto nodes
  Columns derivative_;             ///< ∂(A V + b)/∂q at the Gauss nodes
  Columns offset_, positions_, multipliers_;
  Vector sum_;
  LeadingTerms leading_;
  Vector lambda_, start_curvature_;  ///< workspaces of add_impulse_sizes()
  bool gauss_known_ = false;
  int first_layout_ = -1;  ///< three for each pair of stages: impulses, curvature, rows
};

/// The largest of StageRows::form_size() and impulse_size() over all rows.
double form_size(const std::vector<StageRows>& all);
double impulse_size(const std::vector<StageRows>& all, ConstVectorRef multipliers);

}  // namespace diracstep
