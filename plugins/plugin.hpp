#pragma once

#include <diracstep/plugins/diracstep_plugin.h>

#include <algorithm>
#include <cstddef>
#include <deque>
#include <diracstep/core/jet.hpp>
#include <exception>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

/// The plugin interface for authors who write C++: S is one formula, and its derivatives come by automatic
/// differentiation.  Header only; a plugin links nothing.
///
///   struct Left {  // L_d = h L(q0, (q1 − q0)/h)
///     template <class T>
///     T operator()(const System<T>& system, diracstep_interval step, const Columns<T>& y) const {
///       return step.size * system.lagrangian(step.start, [&](int i) { return y[0][i]; },
///                                            [&](int i) { return (y[1][i] - y[0][i]) / step.size; });
///     }
///   };
///   extern "C" const diracstep_plugin* diracstep_plugin_entry() {
///     static Description plugin("left");
///     static const diracstep_plugin* const made = plugin.method<Left>({"type1/my_left", 1, 1}).get();
///     return made;
///   }
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
  void forget() { answers_known_ = 0; }
  void rewind() { next_ = 0; }

  /// f(t, x, y) with x_i = x(i), y_i = y(i).
  template <class X, class Y>
  T operator()(double t, X x, Y y) {
    if (function_ == nullptr || function_->value == nullptr)
      throw std::runtime_error("the host gives no such function; a Hamiltonian must be asked for");
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
    if (status != 0) throw std::runtime_error("the host's function failed");
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

  void forget() {
    lagrangian_.forget();
    hamiltonian_.forget();
  }
  void rewind() {
    lagrangian_.rewind();
    hamiltonian_.rewind();
  }

 private:
  const diracstep_system* system_;
  mutable HostFunction<T> lagrangian_, hamiltonian_;  // workspaces
};

/// What a method states of itself; see diracstep_method.
struct MethodClaims {
  const char* name;
  int type;
  int order;
  int constrained_order = 0;
  bool self_adjoint = false;
  const char* summary = nullptr;
  const char* constraint_rule = nullptr;
  const char* adjoint = nullptr;
  int inner_columns = 0;
  bool needs_hamiltonian = false;
  bool full_pattern = false;
};

/// Second derivatives lie on the pattern of L where S is made of L; else they fill n×n.
inline bool needs_full_pattern(const MethodClaims& claims) {
  return claims.full_pattern || claims.needs_hamiltonian;
}

/// A formula of S on one scene, with derivatives by automatic differentiation.  The formula is made from the
/// system where it can be, else by default.
template <class Formula>
class Instance {
 public:
  Instance(const MethodClaims& claims, const diracstep_system& system)
      : formula_(make(system)), values_(system), slopes_(system), curvatures_(system), claims_(claims) {
    const auto count =
        static_cast<std::size_t>(system.dimension) * static_cast<std::size_t>(2 + claims.inner_columns);
    first_.resize(count);
    second_.resize(count);
  }

  void value(diracstep_interval step, const double* y, double* s) {
    values_.forget();
    values_.rewind();
    *s = formula_(std::as_const(values_), step, Columns<double>(y, values_.dimension()));
  }

  void gradient(diracstep_interval step, const double* y, double* g) {
    constexpr std::size_t width = Variables<First>::count;
    slopes_.forget();
    for (std::size_t begin = 0; begin < first_.size(); begin += width) {
      const std::size_t end = std::min(begin + width, first_.size());
      for (std::size_t k = 0; k < first_.size(); ++k) first_[k] = First(y[k]);
      for (std::size_t k = begin; k < end; ++k)
        first_[k] = First::variable(y[k], static_cast<int>(k - begin));
      slopes_.rewind();
      const First s =
          formula_(std::as_const(slopes_), step, Columns<First>(first_.data(), slopes_.dimension()));
      for (std::size_t k = begin; k < end; ++k) g[k] = s.gradient(static_cast<int>(k - begin));
    }
  }

  void hessian(diracstep_interval step, const double* y, double* blocks) {
    const std::size_t n = static_cast<std::size_t>(curvatures_.dimension()), columns = second_.size() / n;
    const diracstep_system& host = curvatures_.host();
    const diracstep_pattern pattern =
        needs_full_pattern(claims_) ? diracstep_pattern{} : host.lagrangian.pattern;
    curvatures_.forget();
    for (std::size_t k = 0; k < second_.size(); ++k) second_[k] = Second(y[k]);
    for (std::size_t a = 0; a < columns; ++a)
      for (std::size_t b = a; b < columns; ++b)
        for (std::size_t j = 0; j < n; ++j) {
          const int begin = pattern.column_starts != nullptr ? pattern.column_starts[j] : 0;
          const int end =
              pattern.column_starts != nullptr ? pattern.column_starts[j + 1] : static_cast<int>(n);
          for (int e = begin; e < end; ++e) {
            const auto i =
                static_cast<std::size_t>(pattern.column_starts != nullptr ? pattern.row_indices[e] : e);
            *blocks++ = second_derivative(step, y, a * n + i, b * n + j);
          }
        }
  }

  const std::string& message() const { return message_; }
  void keep(const char* message) { message_ = message; }

 private:
  using First = Jet<4, 1>;   // four first derivatives a pass
  using Second = Jet<2, 2>;  // one second derivative a pass

  static Formula make(const diracstep_system& system) {
    if constexpr (std::is_constructible_v<Formula, const diracstep_system&>)
      return Formula(system);
    else
      return Formula();
  }

  /// ∂²S/∂y_a∂y_b.
  double second_derivative(diracstep_interval step, const double* y, std::size_t a, std::size_t b) {
    second_[b] = Second::variable(y[b], 1);
    second_[a] = Second::variable(y[a], 0);
    curvatures_.rewind();
    const Second s =
        formula_(std::as_const(curvatures_), step, Columns<Second>(second_.data(), curvatures_.dimension()));
    second_[a] = Second(y[a]);
    second_[b] = Second(y[b]);
    return s.hessian(0, a == b ? 0 : 1);
  }

  Formula formula_;
  System<double> values_;
  System<First> slopes_;
  System<Second> curvatures_;
  MethodClaims claims_;
  std::vector<First> first_;
  std::vector<Second> second_;
  std::string message_;
};

/// The C callbacks of a formula.  Exceptions end in them and become error 1 with their text.
template <class Formula>
struct Callbacks {
  static Instance<Formula>& instance(void* self) { return *static_cast<Instance<Formula>*>(self); }

  template <class Action>
  static int guarded(void* self, Action action) {
    try {
      action(instance(self));
      return 0;
    } catch (const std::exception& error) {
      instance(self).keep(error.what());
    } catch (...) {
      instance(self).keep("something was thrown that is no std::exception");
    }
    return 1;
  }

  static int create(const void* claims, const diracstep_system* system, void** self) {
    try {
      *self = new Instance<Formula>(*static_cast<const MethodClaims*>(claims), *system);
      return 0;
    } catch (...) {
      return 1;
    }
  }
  static void destroy(void* self) { delete &instance(self); }

  static int value(void* self, const diracstep_system*, diracstep_interval step, const double* y, double* s) {
    return guarded(self, [&](auto& made) { made.value(step, y, s); });
  }
  static int gradient(void* self, const diracstep_system*, diracstep_interval step, const double* y,
                      double* g) {
    return guarded(self, [&](auto& made) { made.gradient(step, y, g); });
  }
  static int hessian(void* self, const diracstep_system*, diracstep_interval step, const double* y,
                     double* blocks) {
    return guarded(self, [&](auto& made) { made.hessian(step, y, blocks); });
  }
  static const char* error_text(void* self, int) {
    return self != nullptr ? instance(self).message().c_str() : "the formula refused the scene";
  }
};

/// The description of a plugin, put together part by part; it must stay where it is once get() was called, as
/// in a static of diracstep_plugin_entry.
class Description {
 public:
  explicit Description(const char* name, const char* description = nullptr) {
    plugin_.version = DIRACSTEP_PLUGIN_VERSION;
    plugin_.size = sizeof(diracstep_plugin);
    plugin_.name = name;
    plugin_.description = description;
  }
  Description(const Description&) = delete;
  Description& operator=(const Description&) = delete;

  /// A generating function whose S is `Formula`: T operator()(const System<T>&, diracstep_interval, const
  /// Columns<T>&) const, generic in T.
  template <class Formula>
  Description& method(const MethodClaims& claims) {
    using Made = Callbacks<Formula>;
    const MethodClaims& kept = claims_.emplace_back(claims);
    const int flags = (kept.self_adjoint ? DIRACSTEP_SELF_ADJOINT : 0) |
                      (kept.needs_hamiltonian ? DIRACSTEP_NEEDS_HAMILTONIAN : 0) |
                      (needs_full_pattern(kept) ? DIRACSTEP_FULL_PATTERN : 0);
    methods_.push_back({kept.name, kept.summary, kept.type, kept.order, kept.constrained_order, flags,
                        kept.constraint_rule, kept.adjoint, kept.inner_columns, &kept, Made::create,
                        Made::destroy, Made::value, Made::gradient, Made::hessian, nullptr,
                        Made::error_text});
    return *this;
  }

  /// A rule for Δ^d with its nodes and weights.
  Description& rule(const char* name, std::vector<double> nodes, std::vector<double> weights) {
    const Numbers& kept = numbers_.emplace_back(Numbers{std::move(nodes), std::move(weights)});
    rules_.push_back({name, static_cast<int>(kept.nodes.size()), kept.nodes.data(), kept.weights.data()});
    return *this;
  }

  /// A scene; see diracstep_scene.  What it points to must stay where it is.
  Description& scene(const diracstep_scene& scene) {
    scenes_.push_back(scene);
    return *this;
  }

  const diracstep_plugin* get() {
    collect(methods_, method_list_, plugin_.methods, plugin_.method);
    collect(rules_, rule_list_, plugin_.rules, plugin_.rule);
    collect(scenes_, scene_list_, plugin_.scenes, plugin_.scene);
    return &plugin_;
  }

 private:
  struct Numbers {
    std::vector<double> nodes, weights;
  };

  template <class Part>
  static void collect(const std::deque<Part>& parts, std::vector<const Part*>& list, int& count,
                      const Part* const*& first) {
    list.clear();
    for (const Part& part : parts) list.push_back(&part);
    count = static_cast<int>(list.size());
    first = list.data();
  }

  diracstep_plugin plugin_{};
  std::deque<MethodClaims> claims_;
  std::deque<Numbers> numbers_;
  std::deque<diracstep_method> methods_;
  std::deque<diracstep_rule> rules_;
  std::deque<diracstep_scene> scenes_;
  std::vector<const diracstep_method*> method_list_;
  std::vector<const diracstep_rule*> rule_list_;
  std::vector<const diracstep_scene*> scene_list_;
};

}  // namespace diracstep::plugin
