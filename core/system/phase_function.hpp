#pragma once

#include <array>
#include <concepts>
#include <diracstep/core/numerics/dependence.hpp>
#include <diracstep/core/numerics/jet.hpp>
#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/system/point_columns.hpp>
#include <memory>
#include <utility>

namespace diracstep {

/// What is known beforehand of a function's second derivatives; false where it is not known.
struct PhaseStructure {
  bool separable = false;           ///< ∂²f/∂x∂y = 0
  bool y_hessian_constant = false;  ///< ∂²f/∂y² depends on nothing
  bool y_hessian_diagonal = false;
  bool quadratic = false;       ///< every second derivative is constant
  bool y_hessian_zero = false;  ///< f is linear in y
  bool autonomous = false;      ///< f does not depend on t
  bool x_absent = false;        ///< f does not depend on x

  /// f = θ(x)·y − H(x) with θ not constant: a phase-space Lagrangian.
  bool phase_space() const { return y_hessian_zero && !separable; }
};

/// A smooth function f(t, x, y) of two columns of n numbers, with its first and second derivatives.
///
/// Second derivatives come as values on one symmetric n×n pattern shared by the three blocks:
/// fxx(i,j) = ∂²f/∂x_i∂x_j, fxy(i,j) = ∂²f/∂x_i∂y_j, fyy(i,j) = ∂²f/∂y_i∂y_j.
/// On a configuration space of its own (on_space.hpp) x has as many numbers as that stores, and ∂/∂x_i is the
/// derivative along x τ(ε e_i): n of them, and fxx(i,j) = ∂(f_x)_i/∂x_j need not be symmetric.
/// Objects are immutable and may be used from several threads at once.
class PhaseFunction {
 public:
  explicit PhaseFunction(SparsityPattern pattern, PhaseStructure structure = {})
      : pattern_(std::move(pattern)), structure_(structure) {}
  PhaseFunction(const PhaseFunction&) = delete;
  PhaseFunction& operator=(const PhaseFunction&) = delete;
  virtual ~PhaseFunction() = default;

  int dimension() const { return pattern_.rows(); }
  const SparsityPattern& pattern() const { return pattern_; }
  const PhaseStructure& structure() const { return structure_; }

  virtual double value(double t, ConstVectorRef x, ConstVectorRef y) const = 0;
  virtual void gradient(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fx, VectorRef fy) const = 0;
  virtual void hessian(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxx, VectorRef fxy,
                       VectorRef fyy) const = 0;

  /// gradient() at several points, into n×count columns.  A step calls it once for all its stages.
  virtual void gradients(const PointColumns& at, double* fx, double* fy) const;
  /// hessian() at several points, into columns of values on pattern().
  virtual void hessians(const PointColumns& at, double* fxx, double* fxy, double* fyy) const;

  /// ∂(f_y)/∂t with x and y held fixed; zero where f does not depend on the time.
  virtual void gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fyt) const = 0;

  /// ∂(f_x)/∂t with x and y held fixed.  Asked for of degenerate Lagrangians only; the default throws
  /// Misuse.
  virtual void position_gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxt) const;

 private:
  SparsityPattern pattern_;
  PhaseStructure structure_;
};

/// L(t, q, v), energy.  May be degenerate: ∂²L/∂v² need not be invertible.
class Lagrangian : public PhaseFunction {
  using PhaseFunction::PhaseFunction;
};

/// H(t, q, p), energy.
class Hamiltonian : public PhaseFunction {
  using PhaseFunction::PhaseFunction;
};

namespace detail {

/// Whether a formula of these arguments takes the time as its last one.
template <class F, class... Args>
inline constexpr bool takes_time = std::invocable<const F&, const Args&..., const double&>;

/// Calls f(args..., t) where the formula takes the time, f(args...) where it does not.
template <class F, class T, class... Args>
auto call_with_time(const F& f, const T& t, const Args&... args) {
  if constexpr (std::invocable<const F&, const Args&..., const T&>)
    return f(args..., t);
  else
    return f(args...);
}

template <class Scalar, std::size_t N>
std::array<Scalar, N> seed(ConstVectorRef x, int first_variable) {
  std::array<Scalar, N> seeded;
  for (std::size_t i = 0; i < N; ++i) {
    const double value = x[static_cast<Eigen::Index>(i)];
    if constexpr (std::is_same_v<Scalar, double>)
      seeded[i] = value;
    else
      seeded[i] = Scalar::variable(value, first_variable + static_cast<int>(i));
  }
  return seeded;
}

/// The structure of a formula f(x, y), by running it once on Dependence; nothing where it branches.
template <int N, class F>
PhaseStructure structure_of(const F& f) {
  using Scalar = Dependence<2 * N>;
  std::array<Scalar, N> x, y;
  for (std::size_t i = 0; i < N; ++i) {
    x[i] = Scalar::variable(i);
    y[i] = Scalar::variable(N + i);
  }
  try {
    const Scalar s = call_with_time(f, Scalar(), x, y);
    PhaseStructure structure{true, true, true, true, true};
    structure.x_absent = true;
    for (std::size_t i = 0; i < N; ++i)
      if (s.depends_on(i)) structure.x_absent = false;
    for (std::size_t i = 0; i < 2 * N; ++i)
      for (std::size_t j = 0; j < 2 * N; ++j) {
        const bool xy = i < N && j >= N, yy = i >= N && j >= N;
        if (xy && s.second_derivative(i, j)) structure.separable = false;
        if (yy && s.second_derivative_varies(i, j)) structure.y_hessian_constant = false;
        if (yy && i != j && s.second_derivative(i, j)) structure.y_hessian_diagonal = false;
        if (yy && s.second_derivative(i, j)) structure.y_hessian_zero = false;
        if (s.second_derivative_varies(i, j)) structure.quadratic = false;
      }
    structure.autonomous = !takes_time<F, std::array<double, N>, std::array<double, N>>;
    if constexpr (takes_time<F, std::array<double, N>, std::array<double, N>>) {
      // The time is no variable here, so nothing is known to be constant.
      structure.y_hessian_constant = structure.quadratic = false;
    }
    return structure;
  } catch (const typename Scalar::Branches&) {
    return {.autonomous = !takes_time<F, std::array<double, N>, std::array<double, N>>};
  }
}

template <class Base, int N, class F>
class PhaseFormula final : public Base {
 public:
  explicit PhaseFormula(F f) : Base(SparsityPattern::dense(N, N), structure_of<N>(f)), f_(std::move(f)) {}

  double value(double t, ConstVectorRef x, ConstVectorRef y) const override {
    return evaluate<double>(t, x, y);
  }

  void gradient(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fx, VectorRef fy) const override {
    const auto f = evaluate<Jet<2 * N, 1>>(t, x, y);
    for (int i = 0; i < N; ++i) {
      fx[i] = f.gradient(i);
      fy[i] = f.gradient(N + i);
    }
  }

  void hessian(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxx, VectorRef fxy,
               VectorRef fyy) const override {
    const auto f = evaluate<Jet<2 * N, 2>>(t, x, y);
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < N; ++i) {
        fxx[i + j * N] = f.hessian(i, j);
        fxy[i + j * N] = f.hessian(i, N + j);
        fyy[i + j * N] = f.hessian(N + i, N + j);
      }
  }

  void gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fyt) const override {
    if constexpr (takes_time<F, std::array<double, N>, std::array<double, N>>) {
      using Scalar = Jet<2 * N + 1, 2>;
      const Scalar f = f_(seed<Scalar, N>(x, 0), seed<Scalar, N>(y, N), Scalar::variable(t, 2 * N));
      for (int i = 0; i < N; ++i) fyt[i] = f.hessian(N + i, 2 * N);
    } else {
      fyt.setZero();
    }
  }

  void position_gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxt) const override {
    if constexpr (takes_time<F, std::array<double, N>, std::array<double, N>>) {
      using Scalar = Jet<2 * N + 1, 2>;
      const Scalar f = f_(seed<Scalar, N>(x, 0), seed<Scalar, N>(y, N), Scalar::variable(t, 2 * N));
      for (int i = 0; i < N; ++i) fxt[i] = f.hessian(i, 2 * N);
    } else {
      fxt.setZero();
    }
  }

 private:
  template <class Scalar>
  Scalar evaluate(double t, ConstVectorRef x, ConstVectorRef y) const {
    return call_with_time(f_, Scalar(t), seed<Scalar, N>(x, 0), seed<Scalar, N>(y, N));
  }

  F f_;
};

}  // namespace detail

/// A Lagrangian from one formula: `lagrangian<2>([](const auto& q, const auto& v) { return …; })`.
/// The formula takes std::array<T, N> columns q and v (and, if it wants, the time) and must be generic in T.
template <int N, class F>
std::shared_ptr<const Lagrangian> lagrangian(F formula) {
  return std::make_shared<const detail::PhaseFormula<Lagrangian, N, F>>(std::move(formula));
}

/// A Hamiltonian from one formula in q and p (and, if it wants, the time).
template <int N, class F>
std::shared_ptr<const Hamiltonian> hamiltonian(F formula) {
  return std::make_shared<const detail::PhaseFormula<Hamiltonian, N, F>>(std::move(formula));
}

}  // namespace diracstep
