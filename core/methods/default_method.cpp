#include <diracstep/core/methods/composition.hpp>
#include <diracstep/core/methods/default_method.hpp>
#include <diracstep/core/numerics/errors.hpp>

namespace diracstep {

namespace {

constexpr int usual_order = 6;
constexpr int highest_order = 40;  // GL(20)

/// Whether type1/trapezoidal needs no nonlinear solve.
bool explicit_at_the_ends(const Scene& scene) {
  const PhaseStructure& l = scene.lagrangian->structure();
  return scene.rows() == 0 && !scene.force && l.separable && l.y_hessian_constant && l.y_hessian_diagonal &&
         !l.y_hessian_zero;
}

}  // namespace

DefaultMethod default_method(const Scene& scene, int order, const std::optional<ConstraintRule>& rule,
                             int large) {
  if (rule)
    return {"type1/midpoint", order,
            std::string("the ") + rule->description() +
                " rule was asked for; GL(s) has its own nodes for the rows"};
  if (order < 0 || order > highest_order || order % 2 != 0)
    throw Misuse("order " + std::to_string(order) + " without a method: the orders are 2, 4, 6, 8, … " +
                 std::to_string(highest_order) + "; type1/left and type2/euler are of order 1");
  const int p = order > 0 ? order : usual_order;
  const bool is_large = scene.dimension() + scene.rows() > large;
  if (is_large && p <= composition_orders.back() && explicit_at_the_ends(scene))
    return {"type1/trapezoidal", p,
            "explicit here: more than " + std::to_string(large) + " unknowns, no rows"};
  const std::string stages = std::to_string(p / 2);
  return {"type1/gl:" + stages, p,
          order > 0 ? "GL(" + stages + ") has the order asked for"
                    : "GL(3): near the least time for errors of 1e-3; order 8 for small ones"};
}

}  // namespace diracstep
