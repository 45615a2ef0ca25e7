#include <algorithm>
#include <diracstep/core/methods/composition.hpp>
#include <diracstep/core/methods/default_method.hpp>
#include <diracstep/core/numerics/errors.hpp>

namespace diracstep {

namespace {

constexpr int usual_order = 6;
constexpr int highest_order = 40;  // GL(20)

/// Whether type1/trapezoidal needs no nonlinear solve.
bool explicit_at_the_ends(const Scene& scene) {
  if (scene.by_hamiltonian()) return false;
  const PhaseStructure& l = scene.lagrangian->structure();
  return scene.rows() == 0 && !scene.force && l.separable && l.y_hessian_constant && l.y_hessian_diagonal &&
         !l.y_hessian_zero;
}

/// Whether type2/euler needs no nonlinear solve.
bool explicit_by_hamiltonian(const Scene& scene) {
  return scene.by_hamiltonian() && scene.rows() == 0 && !scene.force &&
         scene.hamiltonian->structure().separable;
}

int order_for(double error, int size) {
  if (size <= 12) return error > 1e-5 ? 6 : error > 2e-10 ? 8 : 12;
  if (size <= 30) return error > 1e-8 ? 6 : 8;
  return error > 1e-7 ? 4 : 6;
}

/// An order, and what it follows from.
struct Order {
  int p;
  std::string reason;
};

Order order_of(const MethodRequest& request, int size) {
  if (request.order > 0) return {request.order, "the order given"};
  if (request.error > 0.0)
    return {order_for(request.error, size),
            "for an error of " + to_text(request.error, 3) + " with " + std::to_string(size) + " unknowns"};
  return {usual_order, "near the least time for errors of 1e-3, small ones take 8"};
}

}  // namespace

DefaultMethod default_method(const Scene& scene, const MethodRequest& request) {
  const int size = scene.dimension() + scene.rows();
  const auto& [p, reason] = order_of(request, size);
  if (request.rule) {
    const int own_or_from_error = request.error > 0.0 ? std::min(p, composition_orders.back()) : 0;
    return {"type1/midpoint", request.order != 0 ? request.order : own_or_from_error,
            std::string("the ") + request.rule->description() +
                " rule was asked for; GL(s) has its own nodes for the rows"};
  }
  if (request.order < 0 || p > highest_order || p % 2 != 0)
    throw Misuse("order " + std::to_string(request.order) +
                 " without a method: the orders are 2, 4, 6, 8, … " + std::to_string(highest_order) +
                 "; type1/left and type2/euler are of order 1");
  const std::string order = "order " + std::to_string(p) + ": " + reason;
  if (size > request.large && p <= composition_orders.back() && explicit_at_the_ends(scene))
    return {"type1/trapezoidal", p,
            "explicit here: more than " + std::to_string(request.large) + " unknowns, no rows; " + order, 0.0,
            true};
  if (size > request.large && p <= composition_orders.back() && explicit_by_hamiltonian(scene))
    return {"type2/euler", p,
            "explicit here: more than " + std::to_string(request.large) + " unknowns, no rows; " + order, 0.0,
            true};
  return {"type1/gl:" + std::to_string(p / 2), p, order};
}

}  // namespace diracstep
