#pragma once

#include <diracstep/plugins/diracstep_plugin.h>

#include <algorithm>
#include <cstddef>
#include <deque>
#include <diracstep/core/numerics/jet.hpp>
#include <diracstep/plugins/formula_system.hpp>
#include <exception>
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
    values_.clear();
    values_.rewind();
    *s = formula_(std::as_const(values_), step, Columns<double>(y, values_.dimension()));
  }

  void gradient(diracstep_interval step, const double* y, double* g) {
    constexpr std::size_t width = Variables<First>::count;
    slopes_.clear();
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
    curvatures_.clear();
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
