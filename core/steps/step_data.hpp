#pragma once

#include <algorithm>
#include <cmath>
#include <diracstep/core/dirac/discrete_constraint.hpp>
#include <diracstep/core/numerics/row_scales.hpp>
#include <diracstep/core/steps/length_of_rows.hpp>
#include <diracstep/core/steps/state.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/scene.hpp>

namespace diracstep {

/// What both forms of the step of a generating function share: the frozen data and the two constraints of Δ_Q
/// and Δ^d_Q.
struct StepData {
  StepData(const Scene& scene, int dimension, const ConstraintRule& rule)
      : n(dimension),
        tolerances(scene.tolerances),
        length(length_of_rows(scene)),
        start_rows(scene.constraints, dimension),
        discrete_constraint(scene.constraints, dimension, rule),
        leading_(start_rows.pattern()) {
    linear_rows = std::ranges::all_of(scene.constraints, [](const auto& block) { return block->constant(); });
    for (Vector* column : {&q0, &way_}) column->setZero(n);
    largest_.setZero(rows());
    sizes_.setZero(rows());
    p0.setZero(n);
    end_derivative.setZero(discrete_constraint.pattern().nonzeros());
  }

  void freeze(Interval interval, const State& start) {
    step = interval;
    q0 = start.q;
    p0 = start.p;
    v0 = start.v;
    if (rows() > 0) start_rows.evaluate(step.start, q0);
  }

  int rows() const { return discrete_constraint.rows(); }

  /// Size of the terms of A(q0)ᵀλ.
  double impulse_scale(ConstVectorRef lambda) const {
    return largest_product(start_rows.coefficients().data(), start_rows.pattern().row_indices(),
                           lambda.data());
  }

  /// sizes += those of the terms of A(q0)ᵀλ, coordinate by coordinate.
  void add_impulse_sizes(ConstVectorRef lambda, Vector& sizes) const {
    start_rows.pattern().for_each([&](Eigen::Index e, int r, int c) {
      sizes[c] += std::abs(start_rows.coefficients()[e] * lambda[r]);
    });
  }

  /// Size of the terms that cancel in c(q0,q1).
  double constraint_scale() const {
    const double way = std::max({max_norm(q0), std::abs(step.size) * max_norm(v0), part_of_length * length});
    return scale_of(max_norm(start_rows.coefficients()) * way +
                    std::abs(step.size) * max_norm(start_rows.offsets()));
  }

  /// The same at rest in the origin, where the step leads as far as `increment`.
  void raise_constraint_scale(ConstVectorRef increment, double& scale) const {
    if (scale <= smallest_scale) scale = scale_of(max_norm(start_rows.coefficients()) * max_norm(increment));
  }

  /// Whether the rows f of c are at most `allowed` times a term of theirs, where the step leads as far as
  /// `increment`.
  bool bound(const Vector& increment, const double* f, double allowed) const {
    return leading_.bound(f, 1, 0, allowed, [&](Eigen::Index e, int c) { return term(increment, e, c); });
  }
  /// Scales of the rows by all their terms, see RowScales.
  void scale_rows(const Vector& increment, double level, Eigen::Index first, double block_scale,
                  RowScales& scales) {
    const double largest_way = std::max(max_norm(q0) + max_norm(increment), part_of_length * length);
    RowScales::set_largest(way_, linear_rows ? 0.0 : largest_way, tolerances, level);
    leading_.add_up(start_rows.pattern(), largest_.data(),
                    [&](Eigen::Index e, int c) { return std::abs(start_rows.coefficients()[e]) * way_[c]; });
    leading_.add_up(start_rows.pattern(), sizes_.data(),
                    [&](Eigen::Index e, int c) { return term(increment, e, c); });
    sizes_ += std::abs(step.size) * start_rows.offsets().cwiseAbs();
    scales.set(first, sizes_, largest_, block_scale);
  }

  int n;
  Vector tolerances;
  bool linear_rows;
  double length;  ///< of the rows
  ConstraintsAtPoint start_rows;
  DiscreteConstraint discrete_constraint;
  Interval step{0.0, 1.0};
  Vector q0, p0, v0;
  Vector end_derivative;  ///< ∂c/∂q1, values

 private:
  double term(const Vector& increment, Eigen::Index e, int c) const {
    return std::abs(start_rows.coefficients()[e]) * (std::abs(q0[c]) + std::abs(increment[c]));
  }

  LeadingTerms leading_;
  Vector way_, largest_, sizes_;  ///< workspaces
};

}  // namespace diracstep
