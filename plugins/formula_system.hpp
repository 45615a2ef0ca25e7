#pragma once

#include <diracstep/plugins/diracstep_plugin.h>

#include <cstddef>
#include <deque>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/jet.hpp>
#include <span>
#include <type_traits>
#include <vector>

/// What a formula of S is written in: its columns, and the host's L and H on numbers and on jets.
namespace diracstep::plugin {

/// The columns of S, n scalars each: its two arguments, then the inner ones.
template <class T>
class Columns {
 public:
  Columns(const T* scalars, int dimension) : scalars_(scalars), dimension_(dimension) {}
  std::span<const T> operator[](int column) const {
    return {scalars_ + static_cast<std::ptrdiff_t>(column) * dimension_,
            static_cast<std::size_t>(dimension_)};
  }

 private:
  const T* scalars_;
  int dimension_;
};

/// How many variables a kind of scalar carries, and to what order.
template <class T>
struct Variables;
template <int N, int Order>
struct Variables<Jet<N, Order>> {
  static constexpr int count = N;
  static constexpr int order = Order;
};

/// L or H of the host on scalars of kind T, numbers or jets.  An instance of a method owns one for each kind.
/// The passes of one evaluation of S call it at the same points in the same order; it keeps what the host
/// answered in the first pass for the others.
template <class T>
class HostFunction {
 public:
  void attach(const diracstep_function& function, int dimension) {
    function_ = &function;
    n_ = static_cast<std::size_t>(dimension);
    const int* starts = function.pattern.column_starts;
    entries_ = starts != nullptr ? static_cast<std::size_t>(starts[dimension]) : n_ * n_;
    x_.resize(n_);
    y_.resize(n_);
    here_.resize(2 * n_);
  }

  /// Before the first pass of an evaluation, and before each pass.
  void clear() { answers_known_ = 0; }
  void rewind() { next_ = 0; }

  /// f(t, x, y) with x_i = x(i), y_i = y(i).
  template <class X, class Y>
  T operator()(double t, X x, Y y) {
    if (function_ == nullptr || function_->value == nullptr)
      throw Error("the host gives no such function; a Hamiltonian must be asked for");
    for (std::size_t i = 0; i < n_; ++i) {
      x_[i] = x(static_cast<int>(i));
      y_[i] = y(static_cast<int>(i));
      here_[i] = real(x_[i]);
      here_[n_ + i] = real(y_[i]);
    }
    return expand(answer(t));
  }

 private:
  struct Answer {
    double t = 0.0, f = 0.0;
    std::vector<double> point, gradient, hessian;
  };

  static double real(double x) { return x; }
  template <int N, int Order>
  static double real(const Jet<N, Order>& x) {
    return x.value();
  }

  const Answer& answer(double t) {
    if (next_ == answers_.size()) answers_.emplace_back();
    Answer& a = answers_[next_];
    if (next_ < answers_known_ && a.t == t && a.point == here_) return answers_[next_++];
    a.t = t;
    a.point = here_;
    ask(a, t);
    answers_known_ = ++next_;
    return a;
  }

  void ask(Answer& a, double t) {
    const double *x = here_.data(), *y = here_.data() + n_;
    const diracstep_function& f = *function_;
    int status = f.value(f.data, t, x, y, &a.f);
    if constexpr (!std::is_same_v<T, double>) {
      a.gradient.resize(2 * n_);
      a.hessian.resize(3 * entries_);
      double *g = a.gradient.data(), *h = a.hessian.data();
      if (status == 0) status = f.gradient(f.data, t, x, y, g, g + n_);
      if (status == 0 && Variables<T>::order == 2)
        status = f.hessian(f.data, t, x, y, h, h + entries_, h + 2 * entries_);
    }
    if (status != 0) throw Error("the host's function failed");
  }

  double expand(const Answer& a) const requires std::is_same_v<T, double> { return a.f; }

  /// The chain rule, into the variables of the jets.
  T expand(const Answer& a) const requires(!std::is_same_v<T, double>) {
    T result(a.f);
    for (int k = 0; k < Variables<T>::count; ++k) result += slope(a, k) * T::variable(0.0, k);
    if constexpr (Variables<T>::order == 2)
      for (int k = 0; k < Variables<T>::count; ++k)
        for (int l = 0; l <= k; ++l)
          result += (k == l ? 0.5 : 1.0) * curvature(a, k, l) * (T::variable(0.0, k) * T::variable(0.0, l));
    return result;
  }

  double slope(const Answer& a, int k) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < n_; ++i)
      sum += a.gradient[i] * x_[i].gradient(k) + a.gradient[n_ + i] * y_[i].gradient(k);
    return sum;
  }

  double curvature(const Answer& a, int k, int l) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < n_; ++i)
      sum += a.gradient[i] * x_[i].hessian(k, l) + a.gradient[n_ + i] * y_[i].hessian(k, l);
    const double *xx = a.hessian.data(), *xy = xx + entries_, *yy = xy + entries_;
    for_each_entry([&](std::size_t i, std::size_t j, std::size_t e) {
      sum += xx[e] * x_[i].gradient(k) * x_[j].gradient(l) + yy[e] * y_[i].gradient(k) * y_[j].gradient(l) +
             xy[e] * (x_[i].gradient(k) * y_[j].gradient(l) + x_[i].gradient(l) * y_[j].gradient(k));
    });
    return sum;
  }

  template <class Visit>
  void for_each_entry(Visit visit) const {
    const diracstep_pattern& pattern = function_->pattern;
    std::size_t e = 0;
    for (std::size_t j = 0; j < n_; ++j) {
      const std::size_t count =
          pattern.column_starts != nullptr
              ? static_cast<std::size_t>(pattern.column_starts[j + 1] - pattern.column_starts[j])
              : n_;
      for (std::size_t k = 0; k < count; ++k, ++e)
        visit(pattern.column_starts != nullptr ? static_cast<std::size_t>(pattern.row_indices[e]) : k, j, e);
    }
  }

  const diracstep_function* function_ = nullptr;
  std::size_t n_ = 0, entries_ = 0, next_ = 0, answers_known_ = 0;
  std::vector<T> x_, y_;
  std::vector<double> here_;
  std::deque<Answer> answers_;
};

/// What a formula of S sees of the scene.
template <class T>
class System {
 public:
  explicit System(const diracstep_system& system) : system_(&system) {
    lagrangian_.attach(system.lagrangian, system.dimension);
    hamiltonian_.attach(system.hamiltonian, system.dimension);
  }

  int dimension() const { return system_->dimension; }
  const diracstep_system& host() const { return *system_; }

  /// L(t,q,v) with q_i = q(i), v_i = v(i); H(t,q,p) likewise.
  template <class Q, class V>
  T lagrangian(double t, Q q, V v) const {
    return lagrangian_(t, q, v);
  }
  template <class Q, class P>
  T hamiltonian(double t, Q q, P p) const {
    return hamiltonian_(t, q, p);
  }

  void clear() {
    lagrangian_.clear();
    hamiltonian_.clear();
  }
  void rewind() {
    lagrangian_.rewind();
    hamiltonian_.rewind();
  }

 private:
  const diracstep_system* system_;
  mutable HostFunction<T> lagrangian_, hamiltonian_;  // workspaces
};

}  // namespace diracstep::plugin
