/// Trajectories of a scene with both momentum representatives, and the variations of a curve.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <diracstep/core/dirac/dirac_structure.hpp>
#include <diracstep/core/dirac/discrete_action.hpp>
#include <diracstep/core/methods/registry.hpp>

#include "stepping.hpp"

namespace diracstep::testing {

constexpr double h = 0.05;  ///< of the tests of this folder
constexpr long steps = 20;

/// The trajectory with both momentum representatives.
struct Trajectory {
  std::vector<Vector> q, plus, minus;
};

inline Trajectory trajectory_of(const std::shared_ptr<const Scene>& scene, const IntegratorOptions& options) {
  Trajectory t;
  for (const Sample& s : samples_of(scene, options, steps, Momentum::plus)) {
    t.q.push_back(s.q);
    t.plus.push_back(s.p);
  }
  for (const Sample& s : samples_of(scene, options, steps, Momentum::minus)) t.minus.push_back(s.p);
  return t;
}

/// The covector that a method's S gives over step k: D^±L_d or dH_{d±}, inner columns stationary.
inline Covector differential(GeneratingFunction& s, const Trajectory& t, std::size_t k, bool plus) {
  const GraphOf graph = graph_of(s.type());
  const Interval step{static_cast<double>(k) * h, h};
  Columns y(s.dimension(), s.columns()), g(s.dimension(), s.columns());
  y.col(0) = graph.starts_from_position ? t.q[k] : t.minus[k];
  y.col(1) = graph.ends_at_position ? t.q[k + 1] : t.plus[k + 1];
  if (s.inner_columns() > 0) {
    s.guess_inner(step, t.q[k], t.minus[k], (t.q[k + 1] - t.q[k]) / h, y.rightCols(s.inner_columns()));
    EXPECT_TRUE(make_stationary(s, step, y));
  }
  s.gradient(step, y, g);
  Covector d{y.col(0), y.col(1), g.col(0), g.col(1)};
  if (s.type() != GeneratingType::one) return d;
  return plus ? gamma_plus(d) : gamma_minus(d);
}

/// A basis of Δ_Q at a configuration.
inline Columns basis_of_distribution(const Scene& scene, double t, const Vector& q) {
  ConstraintsAtPoint rows(scene.constraints, scene.dimension());
  rows.evaluate(t, q);
  if (scene.rows() == 0) return Columns::Identity(q.size(), q.size());
  return rows.pattern().full(rows.coefficients()).fullPivLu().kernel();
}

/// Variations of a curve: those of a principle keep the ends, lie in Δ_Q and, for a sum on the phase space,
/// move q¹_k together with q⁰_{k+1}.
struct Variation {
  std::vector<Vector> q0, q1, p;
};

inline Vector admissible(const Scene& scene, double t, const Vector& q) {
  const Columns basis = basis_of_distribution(scene, t, q);
  return basis * Vector::Random(basis.cols());
}

inline Variation random_variation(const Scene& scene, const DiscreteCurve& curve, GeneratingType type) {
  Variation v{curve.q0, curve.q1, curve.p};
  const std::size_t n = curve.steps();
  for (Vector& p : v.p) p = Vector::Random(p.size());
  for (std::size_t k = 0; k < n; ++k) {
    v.q0[k] = admissible(scene, curve.interval(k).start, curve.q0[k]);
    v.q1[k] = admissible(scene, curve.interval(k).end(), curve.q1[k]);
  }
  v.q0.front().setZero();
  v.q1.back().setZero();
  if (type != GeneratingType::one)
    for (std::size_t k = 0; k + 1 < n; ++k) v.q1[k] = v.q0[k + 1];
  return v;
}

inline DiscreteCurve moved_curve(DiscreteCurve curve, const Variation& v, double e) {
  for (std::size_t k = 0; k < curve.p.size(); ++k) curve.p[k] += e * v.p[k];
  for (std::size_t k = 0; k < curve.steps(); ++k) {
    curve.q0[k] += e * v.q0[k];
    curve.q1[k] += e * v.q1[k];
  }
  return curve;
}

/// The derivative of the sum of S along a variation, by fourth-order differences.
inline double sum_derivative(GeneratingFunction& s, const DiscreteCurve& curve, const Variation& v) {
  const double e = 1e-3;
  const auto sum = [&](double at) {
    const DiscreteCurve moved = moved_curve(curve, v, at);
    return s.type() == GeneratingType::one ? hamilton_pontryagin_sum(s, moved) : phase_space_sum(s, moved);
  };
  return (8.0 * (sum(e) - sum(-e)) - (sum(2.0 * e) - sum(-2.0 * e))) / (12.0 * e);
}

inline DiscreteCurve first_steps(DiscreteCurve curve, std::size_t n) {
  curve.q0.resize(n);
  curve.q1.resize(n);
  curve.p.resize(n + 1);
  return curve;
}

}  // namespace diracstep::testing
