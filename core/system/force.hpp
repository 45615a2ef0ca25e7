#pragma once

#include <array>
#include <diracstep/core/numerics/jet.hpp>
#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/system/phase_function.hpp>
#include <memory>
#include <utility>

namespace diracstep {

/// An external or dissipative generalised force f(t, q, v), n components, energy per unit of the coordinate.
/// Derivatives come as values on one symmetric n×n pattern.  Objects are immutable and may be used from
/// several threads at once.
class Force {
 public:
  explicit Force(SparsityPattern pattern) : pattern_(std::move(pattern)) {}
  Force(const Force&) = delete;
  Force& operator=(const Force&) = delete;
  virtual ~Force() = default;

  int dimension() const { return pattern_.rows(); }
  const SparsityPattern& pattern() const { return pattern_; }

  virtual void value(double t, ConstVectorRef q, ConstVectorRef v, VectorRef f) const = 0;
  /// fq(i,j) = ∂f_i/∂q_j,  fv(i,j) = ∂f_i/∂v_j.
  virtual void derivatives(double t, ConstVectorRef q, ConstVectorRef v, VectorRef fq,
                           VectorRef fv) const = 0;

 private:
  SparsityPattern pattern_;
};

namespace detail {

template <int N, class F>
class ForceFormula final : public Force {
 public:
  explicit ForceFormula(F f) : Force(SparsityPattern::dense(N, N)), f_(std::move(f)) {}

  void value(double t, ConstVectorRef q, ConstVectorRef v, VectorRef f) const override {
    const std::array<double, N> values = evaluate<double>(t, q, v);
    for (std::size_t i = 0; i < N; ++i) f[static_cast<Eigen::Index>(i)] = values[i];
  }

  void derivatives(double t, ConstVectorRef q, ConstVectorRef v, VectorRef fq, VectorRef fv) const override {
    const auto f = evaluate<Jet<2 * N, 1>>(t, q, v);
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < N; ++i) {
        fq[i + j * N] = f[static_cast<std::size_t>(i)].gradient(j);
        fv[i + j * N] = f[static_cast<std::size_t>(i)].gradient(N + j);
      }
  }

 private:
  template <class Scalar>
  std::array<Scalar, N> evaluate(double t, ConstVectorRef q, ConstVectorRef v) const {
    return call_with_time(f_, Scalar(t), seed<Scalar, N>(q, 0), seed<Scalar, N>(v, N));
  }

  F f_;
};

}  // namespace detail

/// A force from one formula in q and v (and, if it wants, the time) that returns std::array<T, N>.
template <int N, class F>
std::shared_ptr<const Force> force(F formula) {
  return std::make_shared<const detail::ForceFormula<N, F>>(std::move(formula));
}

}  // namespace diracstep
