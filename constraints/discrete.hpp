#pragma once

#include <array>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/dirac/discrete_rows.hpp>
#include <diracstep/core/numerics/jet.hpp>
#include <diracstep/core/system/phase_function.hpp>

namespace diracstep {

namespace detail {

/// Discrete rows from one formula; a jet in q1 gives ∂c/∂q1.
template <int N, int M, class F>
class FormulaDiscreteRows final : public DiscreteRows {
 public:
  explicit FormulaDiscreteRows(F formula)
      : DiscreteRows(SparsityPattern::dense(M, N)), formula_(std::move(formula)) {}

  void residual(Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef c) const override {
    const auto values = evaluate<double>(step, q0, q1);
    for (std::size_t r = 0; r < M; ++r) c[static_cast<Eigen::Index>(r)] = values[r];
  }

  void end_derivative(Interval step, ConstVectorRef q0, ConstVectorRef q1, VectorRef d) const override {
    const auto c = evaluate<Jet<N, 1>>(step, q0, q1);
    for (int r = 0; r < M; ++r)
      for (int j = 0; j < N; ++j) d[r + j * M] = c[static_cast<std::size_t>(r)].gradient(j);
  }

 private:
  template <class Scalar>
  std::array<Scalar, M> evaluate(Interval step, ConstVectorRef q0, ConstVectorRef q1) const {
    std::array<Scalar, N> start;
    for (std::size_t i = 0; i < N; ++i) start[i] = q0[static_cast<Eigen::Index>(i)];
    const std::array<Scalar, N> end = seed<Scalar, N>(q1, 0);
    if constexpr (std::invocable<const F&, const std::array<Scalar, N>&, const std::array<Scalar, N>&,
                                 const double&, const double&>)
      return formula_(start, end, step.start, step.size);
    else
      return formula_(start, end);
  }

  F formula_;
};

/// The rows A(q) v = 0 with A(q) = ∂c/∂q1 at (q,q).  A second-order jet in both points gives their
/// derivatives along the diagonal, ∂A/∂q = ∂1∂2 c + ∂2∂2 c.
template <int N, int M, class F>
class InducedRows final : public ConstraintRows {
 public:
  InducedRows(F formula, std::vector<std::string> names)
      : ConstraintRows(false, SparsityPattern::dense(M, N), SparsityPattern::dense(N, N), std::move(names)),
        formula_(std::move(formula)) {}

  bool workless() const override { return true; }

  void coefficients(double, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    using Scalar = Jet<N, 1>;
    std::array<Scalar, N> start;
    for (std::size_t i = 0; i < N; ++i) start[i] = q[static_cast<Eigen::Index>(i)];
    const std::array<Scalar, M> c = formula_(start, seed<Scalar, N>(q, 0));
    for (int r = 0; r < M; ++r)
      for (int j = 0; j < N; ++j) a[r + j * M] = c[static_cast<std::size_t>(r)].gradient(j);
    b.setZero();
  }

  void derivative(double, ConstVectorRef q, ConstVectorRef w, double, VectorRef d) const override {
    const auto c = on_the_diagonal(q);
    d.setZero();
    for (int r = 0; r < M; ++r)
      for (int j = 0; j < N; ++j)
        for (int k = 0; k < N; ++k) d[r + k * M] += w[j] * slope(c[static_cast<std::size_t>(r)], j, k);
  }

  void time_derivative(double, ConstVectorRef, ConstVectorRef, VectorRef d) const override { d.setZero(); }

  void annihilator_derivative(double, ConstVectorRef q, ConstVectorRef lambda, VectorRef d) const override {
    const auto c = on_the_diagonal(q);
    d.setZero();
    for (int r = 0; r < M; ++r)
      for (int j = 0; j < N; ++j)
        for (int k = 0; k < N; ++k) d[j + k * N] += lambda[r] * slope(c[static_cast<std::size_t>(r)], j, k);
  }

 private:
  using Pair = Jet<2 * N, 2>;  // variables q0, q1

  std::array<Pair, M> on_the_diagonal(ConstVectorRef q) const {
    return formula_(seed<Pair, N>(q, 0), seed<Pair, N>(q, N));
  }
  /// ∂A_rj/∂q_k.
  static double slope(const Pair& row, int j, int k) {
    return row.hessian(N + j, k) + row.hessian(N + j, N + k);
  }

  F formula_;
};

}  // namespace detail

/// A discrete constraint of one's own, from one formula c(q0, q1) that returns std::array<T, M>:
///
///   discrete_rows<3, 1>([]<class T>(const std::array<T, 3>& q0, const std::array<T, 3>& q1) {
///     return std::array<T, 1>{(q1[0] - q0[0]) + 0.5 * (q0[1] + q1[1]) * (q1[2] - q0[2])}; });
///
/// for IntegratorOptions::constraint_rule.  The formula may take the time at the start and the step size,
/// doubles, as third and fourth arguments.
template <int N, int M, class F>
std::shared_ptr<const DiscreteRows> discrete_rows(F formula) {
  return std::make_shared<const detail::FormulaDiscreteRows<N, M, F>>(std::move(formula));
}

/// The distribution that a discrete constraint induces, Δ_Q(q) = ker ∂c/∂q1 (q,q)  (Leok and Ohsawa
/// (4.18), (4.19)), as nonholonomic rows A(q) v = 0: who has c needs no one-forms.  The formula is that of
/// discrete_rows() without the time, and c(q,q) = 0 for all q (4.17); a scene takes both from it,
///
///   scene.constraints = {induced_rows<3, 1>(c)};   options.constraint_rule = discrete_rows<3, 1>(c);
///
/// and the integrator checks (4.17) along the motion.
template <int N, int M, class F>
std::shared_ptr<const ConstraintRows> induced_rows(F formula, std::vector<std::string> names = {}) {
  return std::make_shared<const detail::InducedRows<N, M, F>>(std::move(formula),
                                                              detail::row_names(std::move(names), M));
}

}  // namespace diracstep
