#pragma once

#include <algorithm>
#include <cmath>
#include <diracstep/core/dirac/discrete_constraint.hpp>
#include <diracstep/core/numerics/row_scales.hpp>
#include <diracstep/core/steps/state.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>

namespace diracstep {

/// What both forms of the step of a generating function share: the frozen data and the two constraints of Δ_Q
/// and Δ^d_Q.
struct StepData {
  StepData(const ConstraintBlocks& constraints, int dimension, const ConstraintRule& rule)
      : n(dimension), start_rows(constraints, dimension), discrete_constraint(constraints, dimension, rule) {
    q0.setZero(n);
    p0.setZero(n);
    end_derivative.setZero(discrete_constraint.pattern().nonzeros());
    forms_.setZero(rows());
    ways_.setZero(rows());
    row_scales_ = RowScales(rows());
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

  /// |A(q0)ᵀλ| by coordinates, added to sizes.
  void add_impulse_sizes(ConstVectorRef lambda, Vector& sizes) const {
    start_rows.pattern().for_each([&](Eigen::Index e, int r, int c) {
      sizes[c] += std::abs(start_rows.coefficients()[e] * lambda[r]);
    });
  }

  /// Scales of the rows c(q0,q1), by the terms that cancel there: A(q0) times positions and the way of the
  /// step.
  void scale_rows(ResidualBlock& block) {
    const double h = std::abs(step.size);
    block.scale = scale_of(max_norm(start_rows.coefficients()) * max_norm(q0));
    size_rows([&](int c) { return std::max(std::abs(q0[c]), h * std::abs(v0[c])); });
    row_scales_.terms += h * start_rows.offsets().cwiseAbs();
    if (block.scale <= smallest_scale) block.scale = scale_of(max_norm(row_scales_.terms));
    row_scales_.give_to(block);
  }
  /// The same for an increment q1 − q0 that is larger than was expected.
  void raise_rows(ConstVectorRef increment) {
    size_rows([&](int c) { return std::abs(increment[c]); });
    for (int r = 0; r < rows(); ++r) row_scales_.raise(r, row_scales_.terms[r]);
  }

  int n;
  ConstraintsAtPoint start_rows;
  DiscreteConstraint discrete_constraint;
  Interval step{0.0, 1.0};
  Vector q0, p0, v0;
  Vector end_derivative;  ///< ∂c/∂q1, values

 private:
  template <class Way>
  void size_rows(Way way) {
    forms_.setZero();
    ways_.setZero();
    start_rows.pattern().for_each([&](Eigen::Index e, int r, int c) {
      forms_[r] = std::max(forms_[r], std::abs(start_rows.coefficients()[e]));
      ways_[r] = std::max(ways_[r], way(c));
    });
    row_scales_.terms = forms_.cwiseProduct(ways_);
  }

  RowScales row_scales_;
  Vector forms_, ways_;
};

}  // namespace diracstep
