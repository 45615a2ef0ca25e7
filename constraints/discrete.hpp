#pragma once

#include <array>
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

}  // namespace diracstep
