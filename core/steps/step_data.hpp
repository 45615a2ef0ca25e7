#pragma once

#include <algorithm>
#include <cmath>
#include <diracstep/core/dirac/discrete_constraint.hpp>
#include <diracstep/core/numerics/scales.hpp>
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
  }

  void freeze(Interval interval, const State& start) {
    step = interval;
    q0 = start.q;
    p0 = start.p;
    if (rows() > 0) start_rows.evaluate(step.start, q0);
  }

  int rows() const { return discrete_constraint.rows(); }

  /// Size of the terms of A(q0)ᵀλ.
  double impulse_scale(ConstVectorRef lambda) const {
    return largest_product(start_rows.coefficients().data(), start_rows.pattern().row_indices(),
                           lambda.data());
  }

  /// Size of the terms that cancel in c(q0,q1).
  double constraint_scale() const { return usable_scale(max_norm(start_rows.coefficients()) * max_norm(q0)); }

  int n;
  ConstraintsAtPoint start_rows;
  DiscreteConstraint discrete_constraint;
  Interval step{0.0, 1.0};
  Vector q0, p0;
  Vector end_derivative;  ///< ∂c/∂q1, values
};

}  // namespace diracstep
