#pragma once

#include <array>
#include <diracstep/constraints/pfaffian.hpp>

namespace diracstep {

namespace detail {

/// Holonomic rows from one formula φ(q, t) → array of M; a second-order jet in (q, t) gives
/// A = ∂φ/∂q, b = ∂φ/∂t and their derivatives.
template <int N, int M, class F>
class HolonomicRows final : public ConstraintRows {
 public:
  HolonomicRows(F phi, std::vector<std::string> names)
      : ConstraintRows(true, SparsityPattern::dense(M, N), SparsityPattern::dense(N, N), std::move(names)),
        phi_(std::move(phi)),
        constant_(is_linear(phi_)) {}

  bool constant() const override { return constant_; }
  bool workless() const override { return !takes_time<F, std::array<double, N>>; }

  void position(double t, ConstVectorRef q, VectorRef phi) const override {
    const auto values = evaluate<double>(t, q);
    for (std::size_t r = 0; r < M; ++r) phi[static_cast<Eigen::Index>(r)] = values[r];
  }

  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    const auto phi = evaluate<Jet<N + 1, 1>>(t, q);
    for (int r = 0; r < M; ++r) {
      const auto& row = phi[static_cast<std::size_t>(r)];
      for (int i = 0; i < N; ++i) a[r + i * M] = row.gradient(i);
      b[r] = row.gradient(N);
    }
  }

  void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) const override {
    const auto phi = evaluate<Second>(t, q);
    for (int r = 0; r < M; ++r)
      for (int j = 0; j < N; ++j) d[r + j * M] = along(phi[static_cast<std::size_t>(r)], j, w, s);
  }

  void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) const override {
    const auto phi = evaluate<Second>(t, q);
    for (int r = 0; r < M; ++r) d[r] = along(phi[static_cast<std::size_t>(r)], N, v, 1.0);
  }

  void annihilator_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, VectorRef d) const override {
    const auto phi = evaluate<Second>(t, q);
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < N; ++i) {
        double sum = 0.0;
        for (int r = 0; r < M; ++r) sum += lambda[r] * phi[static_cast<std::size_t>(r)].hessian(i, j);
        d[i + j * N] = sum;
      }
  }

 private:
  using Second = Jet<N + 1, 2>;  // variables q_1 … q_N, t

  /// ∂/∂(variable j) of (∂φ/∂q w + s ∂φ/∂t).
  static double along(const Second& phi, int j, ConstVectorRef w, double s) {
    double sum = s * phi.hessian(N, j);
    for (int i = 0; i < N; ++i) sum += phi.hessian(i, j) * w[i];
    return sum;
  }

  template <class Scalar>
  std::array<Scalar, M> evaluate(double t, ConstVectorRef q) const {
    if constexpr (std::is_same_v<Scalar, double>)
      return call_with_time(phi_, t, seed<Scalar, N>(q, 0));
    else
      return call_with_time(phi_, Scalar::variable(t, N), seed<Scalar, N>(q, 0));
  }

  /// Whether φ is linear in (q, t), by running it once on Dependence.
  static bool is_linear(const F& phi) {
    using Scalar = Dependence<N + 1>;
    std::array<Scalar, N> q;
    for (std::size_t i = 0; i < N; ++i) q[i] = Scalar::variable(i);
    try {
      for (const Scalar& row : call_with_time(phi, Scalar::variable(N), q))
        for (std::size_t i = 0; i <= N; ++i)
          for (std::size_t j = 0; j <= N; ++j)
            if (row.second_derivative(i, j)) return false;
      return true;
    } catch (const typename Scalar::Branches&) {
      return false;
    }
  }

  F phi_;
  bool constant_;
};

}  // namespace detail

/// Holonomic rows φ(q) = 0 from one formula that returns std::array<T, M>:
///
///   holonomic<2, 1>([]<class T>(const std::array<T, 2>& q) {
///     return std::array<T, 1>{q[0] * q[0] + q[1] * q[1] - 1.0}; });
///
/// The formula may take the time as a second argument.
template <int N, int M, class F>
std::shared_ptr<const ConstraintRows> holonomic(F phi, std::vector<std::string> names = {}) {
  return std::make_shared<const detail::HolonomicRows<N, M, F>>(std::move(phi),
                                                                detail::row_names(std::move(names), M));
}

}  // namespace diracstep
