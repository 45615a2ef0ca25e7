#include <diracstep/core/methods/gauss_lobatto.hpp>
#include <diracstep/core/methods/group_methods.hpp>
#include <diracstep/core/methods/method.hpp>
#include <diracstep/core/methods/quadrature.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/steps/gauss_lobatto/first_order_step.hpp>
#include <diracstep/core/steps/gauss_lobatto/hamiltonian_step.hpp>
#include <diracstep/core/steps/gauss_lobatto/kernel_step.hpp>
#include <diracstep/core/steps/gauss_lobatto/levelled_step.hpp>
#include <diracstep/core/steps/gauss_lobatto/phase_space_step.hpp>
#include <diracstep/core/steps/gauss_lobatto/step.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>
#include <diracstep/core/steps/groups/masses.hpp>
#include <diracstep/core/steps/groups/quadrature_step.hpp>
#include <diracstep/core/steps/groups/step.hpp>
#include <diracstep/core/steps/radau/step.hpp>
#include <diracstep/core/steps/radau/tableau.hpp>
#include <utility>

namespace diracstep {

namespace {

/// The motions of first order that ask for a step of their own.
FirstOrderMotions own_motions(const Scene& scene, const StepChoices& choices) {
  FirstOrderMotions motions = choices.force_degenerate ? FirstOrderMotions{} : first_order_motions(scene);
  return motions.by_force ? FirstOrderMotions{} : motions;
}

std::unique_ptr<StepProblem> step_of_first_order(int s, const Scene& scene, const FirstOrderMotions& motions,
                                                 bool dense) {
  if (!motions.levels.empty()) return levelled_step(s, scene, motions);
  if (motions.hide_equations()) return kernel_step(s, scene, motions);
  const bool alone = scene.rows() == 0 && !scene.force && scene.lagrangian->structure().phase_space();
  return alone ? phase_space_step(s, scene, dense) : first_order_step(s, scene, motions);
}

/// Throws Misuse on a configuration space of its own.
void require_flat(const Scene& scene, const std::string& what) {
  if (scene.space)
    throw Misuse(
        "scene '" + scene.name + "' on " + scene.space->name() + ": " + what +
        " is known in R^n only; typeN/gl:S, type1/left, right, midpoint and trapezoidal, type2/euler, "
        "type3/euler and their transforms step it");
}

bool asks_for_own_rule(const StepChoices& choices, const StepRule& own) {
  return !choices.rule || (!choices.rule->own && choices.rule->nodes == own);
}

/// The rule asked for; with a discretisation of the user's own, forces keep the method's nodes.
ConstraintRule applied_rule(const StepChoices& choices, const StepRule& own) {
  ConstraintRule applied = own;
  if (choices.rule && choices.rule->own) applied.own = choices.rule->own;
  if (choices.rule && !choices.rule->own) applied.nodes = choices.rule->nodes;
  return applied;
}

StepFactory gauss_lobatto_factory(const std::string& name, int s) {
  return [name, s](const Scene& scene, const StepChoices& choices) {
    if (const FirstOrderMotions motions = own_motions(scene, choices); motions.exist())
      return step_of_first_order(s, scene, motions, choices.dense);
    if (!asks_for_own_rule(choices, StepRule::midpoint))
      throw Misuse("method '" + name + "' has its own nodes for the constraint; no other rule applies");
    if (scene.space && !choices.force_degenerate) require_masses(scene);
    if (scene.space) return group_step(s, scene);
    if (scene.by_hamiltonian()) return hamiltonian_step(s, scene, choices.dense);
    return gauss_lobatto_step(s, scene, choices.dense);
  };
}

}  // namespace

StepFactory with_group_step(const MethodInfo& info, StepFactory in_flat_space) {
  return [name = info.name, rule = info.constraint_rule, in_flat_space = std::move(in_flat_space)](
             const Scene& scene, const StepChoices& choices) {
    if (!scene.space) return in_flat_space(scene, choices);
    if (!asks_for_own_rule(choices, rule))
      throw Misuse("method '" + name + "' on " + scene.space->name() + " has its own rule for the rows");
    if (!choices.force_degenerate) require_masses(scene);
    return group_quadrature_step(rule, scene);
  };
}

StepFactory with_group_step_of(const MethodInfo& info, StepFactory in_flat_space, StepFactory on_group) {
  if (info.type != GeneratingType::four)
    return [in_flat_space = std::move(in_flat_space), on_group = std::move(on_group)](
               const Scene& scene, const StepChoices& choices) {
      return scene.space ? on_group(scene, choices) : in_flat_space(scene, choices);
    };
  return [name = info.name, in_flat_space = std::move(in_flat_space)](const Scene& scene,
                                                                      const StepChoices& choices) {
    require_flat(scene, "a function of two momenta and no configuration, as that of '" + name +
                            "', has no point whose chart they could be compared in and");
    return in_flat_space(scene, choices);
  };
}

std::string prefix_of(GeneratingType type) { return "type" + std::to_string(static_cast<int>(type)) + "/"; }

Method method_of(MethodInfo info, GeneratingFunctionFactory generating_function) {
  const auto make_step = [name = info.name, own = info.constraint_rule, generating_function](
                             const Scene& scene, const StepChoices& choices) {
    require_flat(scene, "the step of '" + name + "'");
    if (own_motions(scene, choices).exist())
      throw Misuse("scene '" + scene.name +
                   "': its Lagrangian is linear in v, in some of them, or otherwise degenerate; there '" +
                   name + "' is unstable or leaves p = ∂L/∂v; use type1/midpoint or typeN/gl:S");
    return dirac_step(generating_function(scene), scene, applied_rule(choices, own), choices.dense);
  };
  return {std::move(info), make_step, std::move(generating_function)};
}

Method gauss_lobatto_method(GeneratingType type, int s) {
  gauss_lobatto_tableau(s);  // throws for a number of stages that is not allowed
  const std::string stages = std::to_string(s), name = prefix_of(type) + "gl:" + stages;
  if (type == GeneratingType::four)
    throw Misuse("'" + name + "': the Gauss-Lobatto generating functions are of types 1, 2 and 3");
  const bool first = type == GeneratingType::one;
  MethodInfo info{
      .name = name,
      .type = type,
      .order = 2 * s,
      .self_adjoint = true,
      .constraint_rule = StepRule::midpoint,
      .summary = "Gauss-Lobatto Dirac step, " + stages + (s == 1 ? " stage" : " stages"),
      .stages = s,
      .rows_inside = true,
      .solved_as = first ? "solved for its stage velocities"
                         : "the same step as type1/gl:" + stages + ", solved for its stage velocities"};
  return {std::move(info), gauss_lobatto_factory(name, s), [s, type](const Scene& scene) {
            require_flat(scene, "the generating function of a step GL(s)");
            return gauss_lobatto_function(type, s, lagrangian_of(scene));
          }};
}

Method radau_method(int s) {
  radau_tableau(s);  // throws for a number of stages that is not allowed
  const std::string stages = std::to_string(s), name = "damped/radau:" + stages;
  MethodInfo info{.name = name,
                  .type = std::nullopt,
                  .order = 2 * s - 1,
                  .self_adjoint = false,
                  .constraint_rule = StepRule::right,
                  .summary = "Radau IIA, " + stages + (s == 1 ? " stage" : " stages") +
                             "; damps what is too fast, no generating function",
                  .damped = true,
                  .rows_inside = true,
                  .solved_as = "solved for its stage velocities"};
  const auto make_step = [name, s](const Scene& scene, const StepChoices& choices) {
    if (choices.rule)
      throw Misuse("method '" + name + "' has its own nodes for the constraint; no other rule applies");
    require_flat(scene, "the step of '" + name + "'");
    return radau_step(s, scene, choices.dense);
  };
  return {std::move(info), make_step};
}

Method midpoint_method() {
  MethodInfo info{.name = "type1/midpoint",
                  .type = GeneratingType::one,
                  .order = 2,
                  .self_adjoint = true,
                  .constraint_rule = StepRule::midpoint,
                  .summary = "L_d = h L((q0+q1)/2, (q1-q0)/h)",
                  .allocation_free = true,
                  .stages = 1,
                  .solved_as = "the same step as GL(1), solved for its velocity"};
  Method method = method_of(std::move(info), [](const Scene& scene) {
    return quadrature_lagrangian(lagrangian_of(scene), StepRule::midpoint);
  });
  method.make_step = [stated = method.make_step, as_gl1 = gauss_lobatto_factory(method.info.name, 1)](
                         const Scene& scene, const StepChoices& choices) {
    const bool own_rule = asks_for_own_rule(choices, StepRule::midpoint);
    return own_rule || own_motions(scene, choices).exist() ? as_gl1(scene, choices) : stated(scene, choices);
  };
  return method;
}

Method trapezoidal_method() {
  MethodInfo info{.name = "type1/trapezoidal",
                  .type = GeneratingType::one,
                  .order = 2,
                  .self_adjoint = true,
                  .constraint_rule = StepRule::trapezoidal,
                  .summary = "L_d = h/2 [L(q0, (q1-q0)/h) + L(q1, (q1-q0)/h)]",
                  .allocation_free = true};
  Method method = method_of(std::move(info), [](const Scene& scene) {
    return quadrature_lagrangian(lagrangian_of(scene), StepRule::trapezoidal);
  });
  method.make_step = with_group_step(method.info, std::move(method.make_step));
  return method;
}

}  // namespace diracstep
