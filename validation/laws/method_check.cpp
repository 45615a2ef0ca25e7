#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/runs/step_loop.hpp>
#include <diracstep/validation/laws/law_scenes.hpp>
#include <diracstep/validation/laws/method_check_parts.hpp>
#include <diracstep/validation/laws/single_step.hpp>

namespace diracstep {

Vector checks::state_after(Integrator& integrator, long steps) {
  const StepReport last = take_steps(integrator, steps);
  if (!last.ok()) throw Error(last.failure);
  Sample end;
  if (!integrator.sample(Momentum::projected, end).ok()) throw Error("the state cannot be read");
  Vector state(end.q.size() + end.p.size());
  state << end.q, end.p;
  return state;
}

namespace {

using namespace checks;

constexpr double order_tolerance = 0.2;  // as in the order table

Check check_symplecticity(const Subject& subject) {
  if (subject.method.info.damped) return not_applicable("not claimed: the method damps");
  const double defect = symplecticity_defect(subject.registry, laws::unconstrained(), subject.stepping());
  return at_most(defect, 1e-8, "largest entry of MᵀΩM − Ω, h = 0.05");
}

Check check_consistency(const Subject& subject) {
  std::vector<double> errors;
  for (const double h : {0.04, 0.02}) {
    Integrator fine(laws::unconstrained(), subject.registry, kinsol(),
                    {.method = "type1/gl:6", .step = h / 4});
    const Vector expected = state_after(fine, 4);
    const auto ours = subject.integrator(laws::unconstrained(), h);
    errors.push_back((state_after(*ours, 1) - expected).lpNorm<Eigen::Infinity>());
  }
  if (errors.back() < 1e-12) return pass_if(true, errors.back(), 1e-12, "error of one step, h = 0.02");
  const double exponent = std::log2(errors.front() / errors.back());
  return pass_if(exponent > 1.5, exponent, 1.5, "the error of one step falls as this power of h");
}

Check check_order(const Subject& subject, const OrderScene& scene) {
  const MethodInfo& info = subject.method.info;
  if (!takes(subject.method, scene))
    return not_applicable(scene.scene->force ? "type 4 takes no forces"
                                             : "only the Gauss-Lobatto and the damping family");
  const int claimed = claimed_order(info, *scene.scene);
  const OrderMeasurement measured = measure_order(subject.registry, scene, subject.stepping());
  if (claimed > highest_visible_order && (measured.failure.empty() || measured.in_round_off))
    return pass_if(!(measured.order < highest_visible_order - order_tolerance), measured.order, claimed,
                   "8 or more is measured; the rest of so high an order is lost in round-off");
  if (!measured.failure.empty()) return pass_if(false, measured.order, claimed, measured.failure);
  return pass_if(std::abs(measured.order - claimed) <= order_tolerance, measured.order, claimed,
                 "measured and claimed order");
}

Check check_self_adjointness(const Subject& subject) {
  if (!subject.method.info.self_adjoint)
    return not_applicable("not claimed",
                          reversal_defect(subject.registry, laws::unconstrained(), subject.stepping()));
  double largest = 0.0;
  for (const auto& scene : {laws::unconstrained(), laws::nonholonomic(), laws::mixed()}) {
    const double defect = reversal_defect(subject.registry, scene, subject.stepping());
    largest = std::isnan(defect) ? HUGE_VAL : std::max(largest, defect);
  }
  return at_most(largest, law_limit, "a step there and back misses the start by this");
}

Check check_membership(const Subject& subject) {
  if (!subject.method.generating_function) return not_applicable("no generating function is stated");
  if (subject.method.info.type == GeneratingType::four) return not_applicable("none is stated for type 4");
  double largest = 0.0;
  for (const auto& scene : laws::every_constraint_class()) {
    const double residual = membership_residual(subject.registry, scene, subject.stepping(), 20);
    largest = std::isnan(residual) ? HUGE_VAL : std::max(largest, residual);
  }
  return at_most(largest, law_limit, "largest residual of membership in D_d+ and D_d-, 20 steps a class");
}

Check check_stated_step(const Subject& subject) {
  if (!subject.method.generating_function) return not_applicable("no generating function is stated");
  double largest = 0.0;
  std::vector<std::shared_ptr<const Scene>> scenes{laws::driven()};
  for (const auto& scene : laws::every_constraint_class()) {
    scenes.push_back(scene);
    if (subject.method.info.type != GeneratingType::four) scenes.push_back(laws::forced(scene));
  }
  for (const auto& scene : scenes) {
    if (!laws::generating_function_determines(subject.method, *scene)) continue;
    const double defect = laws::stated_step_defect(subject.method, *scene, usual_step);
    largest = std::isnan(defect) ? HUGE_VAL : std::max(largest, defect);
  }
  return at_most(largest, law_limit, "a step ends so far from that of its generating function");
}

/// Largest violation along a run: of φ(q) = 0, or of A v + b = 0.
double violation(const Subject& subject, const std::shared_ptr<const Scene>& scene, bool positions) {
  const auto integrator = subject.integrator(scene);
  double largest = 0.0;
  const auto look = [&](const Sample& at) {
    for (const auto& rows : scene->constraints) {
      Vector a(rows->pattern().nonzeros()), residual(rows->rows());
      rows->coefficients(at.time, at.q, a, residual);
      rows->pattern().multiply_add(a.data(), at.v.data(), residual.data());
      if (positions && !rows->holonomic()) continue;
      if (positions) rows->position(at.time, at.q, residual);
      largest = std::max(largest, residual.lpNorm<Eigen::Infinity>());
    }
    return true;
  };
  const RunReport report = run_steps(*integrator, 100, Momentum::projected, 1, look);
  if (!report.ok()) throw Error(scene->name + ": " + report.last.failure);
  return largest;
}

Check check_holonomic_rows(const Subject& subject) {
  const double largest =
      std::max(violation(subject, laws::holonomic_sphere(), true), violation(subject, laws::mixed(), true));
  return at_most(largest, law_limit, "largest |phi(q)|, 100 steps of 0.05");
}

Check check_nonholonomic_rows(const Subject& subject) {
  const double largest =
      std::max(violation(subject, laws::nonholonomic(), false), violation(subject, laws::mixed(), false));
  return at_most(largest, law_limit, "largest |A v + b|, 100 steps of 0.05");
}

/// The check, with what it throws turned into a failure.
template <class Body>
void add(ConformanceTable& table, const CheckOptions& options, const std::string& name, Body body) {
  if (options.proceed && !options.proceed(name)) return;
  Check check;
  try {
    check = body();
  } catch (const std::exception& error) {
    check = pass_if(false, nothing, nothing, error.what());
  }
  check.name = name;
  table.checks.push_back(std::move(check));
}

}  // namespace

bool ConformanceTable::passed() const {
  return std::ranges::none_of(checks, [](const Check& c) { return c.result == Check::Result::fail; });
}

ConformanceTable check_method(const Registry& registry, const std::string& method,
                              const std::vector<OrderScene>& scenes, const CheckOptions& options) {
  const Subject subject{registry, registry.method(method), options};
  ConformanceTable table{method, {}};
  const auto perform = [&](const std::string& name, Check (*body)(const Subject&)) {
    add(table, options, name, [&] { return body(subject); });
  };
  perform("gradient", checks::gradient);
  perform("hessian", checks::hessian);
  perform("symplecticity", check_symplecticity);
  perform("consistency", check_consistency);
  for (const OrderScene& scene : scenes)
    add(table, options, "order, " + scene.constraint_class, [&] { return check_order(subject, scene); });
  perform("self-adjointness", check_self_adjointness);
  perform("stated step", check_stated_step);
  perform("membership", check_membership);
  perform("holonomic rows", check_holonomic_rows);
  perform("nonholonomic rows", check_nonholonomic_rows);
  perform("allocation", checks::allocation);
  perform("two instances", checks::two_instances);
  perform("not a number", checks::not_a_number);
  return table;
}

ConformanceTable check_rule(const Registry& registry, const std::string& rule,
                            const std::vector<OrderScene>& scenes) {
  const StepRule looked_at = registry.rule(rule);
  double centre = 0.0;
  for (const StepNode& node : looked_at.nodes()) centre += node.weight * node.c;
  const int expected = std::abs(centre - 0.5) < 1e-12 ? 2 : 1;
  ConformanceTable table{rule, {}};
  for (const OrderScene& scene : scenes) {
    if (scene.constraint_class != "nonholonomic") continue;
    add(table, {}, "order, nonholonomic", [&] {
      const OrderMeasurement measured =
          measure_order(registry, scene, {.method = "type1/midpoint", .constraint_rule = looked_at});
      if (!measured.failure.empty()) return pass_if(false, measured.order, expected, measured.failure);
      return pass_if(std::abs(measured.order - expected) <= order_tolerance, measured.order, expected,
                     "with type1/midpoint; " + std::to_string(expected) + " follows from the nodes");
    });
  }
  return table;
}

}  // namespace diracstep
