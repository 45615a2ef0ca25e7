#pragma once

#include <array>
#include <diracstep/core/numerics/dependence.hpp>
#include <diracstep/core/numerics/jet.hpp>
#include <diracstep/core/system/constraint_rows.hpp>
#include <diracstep/core/system/phase_function.hpp>

namespace diracstep {

namespace detail {

/// Names "1", "2", … for rows that were given none.
std::vector<std::string> row_names(std::vector<std::string> names, int rows);

/// b = 0: the rows are linear in v.
struct NoOffset {};

/// Nonholonomic rows from formulas A(q, t) → array of M rows of N, and b(q, t) → array of M.
/// One jet in (q, t) gives A, b and all their first derivatives.
template <int N, int M, class A, class B>
class PfaffianRows final : public ConstraintRows {
 public:
  PfaffianRows(A a, B b, std::vector<std::string> names)
      : ConstraintRows(false, SparsityPattern::dense(M, N), SparsityPattern::dense(N, N), std::move(names)),
        a_(std::move(a)),
        b_(std::move(b)),
        constant_(are_constant(a_, b_)) {}

  bool constant() const override { return constant_; }
  bool workless() const override {
    return std::is_same_v<B, NoOffset> && !takes_time<A, std::array<double, N>>;
  }

  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    const auto rows = evaluate_a<double>(t, q);
    const auto offset = evaluate_b<double>(t, q);
    for (std::size_t r = 0; r < M; ++r) {
      for (std::size_t i = 0; i < N; ++i) a[static_cast<Eigen::Index>(r + i * M)] = rows[r][i];
      b[static_cast<Eigen::Index>(r)] = offset[r];
    }
  }

  void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) const override {
    const auto sums = contract_with_velocity(t, q, w, s);
    for (int r = 0; r < M; ++r)
      for (int j = 0; j < N; ++j) d[r + j * M] = sums[static_cast<std::size_t>(r)].gradient(j);
  }

  void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) const override {
    const auto sums = contract_with_velocity(t, q, v, 1.0);
    for (int r = 0; r < M; ++r) d[r] = sums[static_cast<std::size_t>(r)].gradient(N);
  }

  void annihilator_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, VectorRef d) const override {
    const auto rows = evaluate_a<QTime>(t, q);
    for (std::size_t i = 0; i < N; ++i) {
      QTime sum;
      for (std::size_t r = 0; r < M; ++r) sum += rows[r][i] * lambda[static_cast<Eigen::Index>(r)];
      for (int j = 0; j < N; ++j) d[static_cast<int>(i) + j * N] = sum.gradient(j);
    }
  }

 private:
  using QTime = Jet<N + 1, 1>;  // variables q_1 … q_N, t

  template <class Scalar>
  static Scalar time(double t) {
    if constexpr (std::is_same_v<Scalar, double>)
      return t;
    else
      return Scalar::variable(t, N);
  }

  template <class Scalar>
  std::array<std::array<Scalar, N>, M> evaluate_a(double t, ConstVectorRef q) const {
    return call_with_time(a_, time<Scalar>(t), seed<Scalar, N>(q, 0));
  }

  template <class Scalar>
  std::array<Scalar, M> evaluate_b(double t, ConstVectorRef q) const {
    if constexpr (std::is_same_v<B, NoOffset>)
      return {};
    else
      return call_with_time(b_, time<Scalar>(t), seed<Scalar, N>(q, 0));
  }

  std::array<QTime, M> contract_with_velocity(double t, ConstVectorRef q, ConstVectorRef w, double s) const {
    const auto rows = evaluate_a<QTime>(t, q);
    auto sums = evaluate_b<QTime>(t, q);
    for (std::size_t r = 0; r < M; ++r) {
      sums[r] *= s;
      for (std::size_t i = 0; i < N; ++i) sums[r] += rows[r][i] * w[static_cast<Eigen::Index>(i)];
    }
    return sums;
  }

  /// Whether A depends on nothing and b on the time alone, by running both once on Dependence: their products
  /// with further variables then have no second derivatives by q, nor those of A by the time.
  static bool are_constant(const A& a, const B& b) {
    using Scalar = Dependence<2 * N + 1>;
    std::array<Scalar, N> q;
    for (std::size_t i = 0; i < N; ++i) q[i] = Scalar::variable(i);
    const Scalar t = Scalar::variable(2 * N);
    try {
      const std::array<std::array<Scalar, N>, M> rows = call_with_time(a, t, q);
      for (const auto& row : rows)
        for (std::size_t i = 0; i < N; ++i)
          if (varies(row[i] * Scalar::variable(N + i), N + i, true)) return false;
      if constexpr (!std::is_same_v<B, NoOffset>) {
        const std::array<Scalar, M> offset = call_with_time(b, t, q);
        for (const Scalar& entry : offset)
          if (varies(entry * Scalar::variable(N), N, false)) return false;
      }
      return true;
    } catch (const typename Scalar::Branches&) {
      return false;
    }
  }

  static bool varies(const Dependence<2 * N + 1>& product, std::size_t factor, bool with_time) {
    for (std::size_t j = 0; j < N; ++j)
      if (product.second_derivative(j, factor)) return true;
    return with_time && product.second_derivative(2 * N, factor);
  }

  A a_;
  B b_;
  bool constant_;
};

}  // namespace detail

/// Nonholonomic rows A(q) v = 0 from one formula that returns std::array<std::array<T, N>, M>:
///
///   pfaffian<3, 1>([]<class T>(const std::array<T, 3>& q) {
///     return std::array<std::array<T, 3>, 1>{{{sin(q[2]), -cos(q[2]), T(0)}}}; });
///
/// The formula may take the time as a second argument.
template <int N, int M, class A>
std::shared_ptr<const ConstraintRows> pfaffian(A rows, std::vector<std::string> names = {}) {
  return std::make_shared<const detail::PfaffianRows<N, M, A, detail::NoOffset>>(
      std::move(rows), detail::NoOffset{}, detail::row_names(std::move(names), M));
}

/// Affine nonholonomic rows A(q) v + b(q) = 0; b returns std::array<T, M>.  Both may take the time.
template <int N, int M, class A, class B>
std::shared_ptr<const ConstraintRows> affine(A rows, B offset, std::vector<std::string> names = {}) {
  return std::make_shared<const detail::PfaffianRows<N, M, A, B>>(std::move(rows), std::move(offset),
                                                                  detail::row_names(std::move(names), M));
}

}  // namespace diracstep
