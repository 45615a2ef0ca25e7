#include <diracstep/core/integrator/step_design.hpp>
#include <diracstep/core/methods/composition.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <utility>

namespace diracstep {

namespace {

/// The rule for the rows in the step of the method, or in that of its adjoint.
std::optional<ConstraintRule> rule_of_part(const IntegratorOptions& options, bool adjoint) {
  const std::optional<ConstraintRule>& given = options.constraint_rule;
  if (!given || !adjoint) return given;
  if (given->own)
    throw Misuse("a discrete constraint of one's own has no adjoint; compose a method that is self-adjoint");
  return ConstraintRule(mirrored(given->nodes));
}

std::function<std::unique_ptr<StepProblem>()> part(const std::shared_ptr<const Scene>& scene,
                                                   const Method& method, const IntegratorOptions& options,
                                                   bool full, bool adjoint) {
  const std::optional<ConstraintRule> rule = rule_of_part(options, adjoint);
  const bool force = options.force_degenerate, compensated = options.compensated_sums;
  return [=] {
    auto problem = method.make_step(*scene, {full, rule, force});
    if (compensated && !problem->compensate())
      throw Misuse("method '" + method.info.name + "' on scene '" + scene->name +
                   "' has no compensated sums; type1/midpoint and typeN/gl:S have");
    return problem;
  };
}

std::vector<std::pair<double, std::size_t>> composed(const MethodInfo& info, int order) {
  if (info.damped)
    throw Misuse("method '" + info.name + "' of order " + std::to_string(info.order) +
                 " is not composed; damped/radau:S has order 2S − 1, S = 1 … 5");
  const int own = info.self_adjoint ? info.order : info.order + info.order % 2;
  const auto fractions = composition_fractions(!info.self_adjoint && order == own ? 2 : order);
  if (order < own || order == info.order)
    throw Misuse("method '" + info.name + "' of order " + std::to_string(info.order) +
                 " cannot be composed to order " + std::to_string(order));
  std::vector<std::pair<double, std::size_t>> stages;
  for (const double fraction : fractions) {
    if (info.self_adjoint) {
      stages.emplace_back(fraction, 0);
      continue;
    }
    stages.emplace_back(fraction / 2.0, 0);
    stages.emplace_back(fraction / 2.0, 1);
  }
  return stages;
}

}  // namespace

Method chosen_method(const Scene& scene, const Registry& registry, IntegratorOptions& options,
                     std::vector<PlanLine>& plan) {
  if (options.method == automatic_method) {
    const DefaultMethod choice =
        default_method(scene, {options.order, 0.0, options.constraint_rule, large_from(options.dense_limit)});
    options.method = choice.method;
    options.order = choice.order;
    plan.push_back({"method", "by default", choice.reason});
  }
  Method method = registry.method(options.method);
  if (options.order == 0) options.order = method.info.order;
  return method;
}

StepDesign design_step(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                       const Method& method, const IntegratorOptions& options, bool full) {
  if (options.constraint_rule && options.constraint_rule->own)
    require_discretisation(*options.constraint_rule->own, scene->constraints, scene->start.time,
                           scene->start.q);
  StepDesign design;
  design.parts.push_back(part(scene, method, options, full, false));
  if (options.order == method.info.order) {
    design.stages = {{1.0, 0}};
    return design;
  }
  design.stages = composed(method.info, options.order);
  if (!method.info.self_adjoint)
    design.parts.push_back(part(scene, registry.adjoint_of(method), options, full, true));
  return design;
}

}  // namespace diracstep
