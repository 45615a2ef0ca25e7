// A plugin in C++: the continuous Galerkin discrete Lagrangian of degree 2 with Simpson's rule.
//
//   S(q0,q1; u) = h Σ b_i L(t_i, q(c_i), q'(c_i)/h),     c = 0, ½, 1,     b = 1/6, 4/6, 1/6,
//
// where q(c) is the parabola through q0, u, q1 at c = 0, ½, 1, and S is stationary in the inner column u.
// Order 4 without rows (Marsden, West 2001, 2.6.5; Lobatto IIIA–IIIB with three stages), order 2 with rows or
// a force, which act at the ends of the step alone.  Only S is written down; the derivatives are automatic.
#include <diracstep/plugins/plugin.hpp>

using namespace diracstep::plugin;

namespace {

struct Galerkin2 {
  template <class T>
  T operator()(const System<T>& system, diracstep_interval step, const Columns<T>& y) const {
    const auto q0 = y[0], q1 = y[1], u = y[2];
    const double h = step.size;
    const auto node = [&](double c) {
      const double l0 = (1 - c) * (1 - 2 * c), lu = 4 * c * (1 - c), l1 = c * (2 * c - 1);
      const double d0 = 4 * c - 3, du = 4 - 8 * c, d1 = 4 * c - 1;
      return system.lagrangian(
          step.start + c * h, [&](int i) -> T { return l0 * q0[i] + lu * u[i] + l1 * q1[i]; },
          [&](int i) -> T { return (d0 * q0[i] + du * u[i] + d1 * q1[i]) / h; });
    };
    return h / 6.0 * (node(0.0) + 4.0 * node(0.5) + node(1.0));
  }
};

}  // namespace

extern "C" const diracstep_plugin* diracstep_plugin_entry() {
  static Description plugin("galerkin", "continuous Galerkin discrete Lagrangians");
  static const diracstep_plugin* const made =
      plugin
          .method<Galerkin2>({.name = "type1/galerkin2",
                              .type = 1,
                              .order = 4,
                              .constrained_order = 2,
                              .self_adjoint = true,
                              .summary = "parabola, Simpson's rule, one inner stage",
                              .inner_columns = 1})
          .rule("simpson", {0.0, 0.5, 1.0}, {1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0})
          .get();
  return made;
}
