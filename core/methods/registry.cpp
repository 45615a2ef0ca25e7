#include <algorithm>
#include <diracstep/core/methods/adjoint.hpp>
#include <diracstep/core/methods/euler.hpp>
#include <diracstep/core/methods/gauss_lobatto.hpp>
#include <diracstep/core/methods/legendre.hpp>
#include <diracstep/core/methods/quadrature.hpp>
#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/steps/gauss_lobatto/phase_space_step.hpp>
#include <diracstep/core/steps/gauss_lobatto/step.hpp>
#include <diracstep/core/steps/gauss_lobatto/tableau.hpp>

namespace diracstep {

namespace {

std::string prefix_of(GeneratingType type) { return "type" + std::to_string(static_cast<int>(type)) + "/"; }

constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_:.-";
/// A name may hold names, which are read by recursion.
constexpr std::size_t longest_name = 1000;

void add_quadrature(Registry& registry, StepRule rule, int order, std::string summary,
                    std::string adjoint = {}) {
  // GL(1) is the midpoint step with the velocity as its unknown, which loses a factor h less to round-off.
  StepFactory step;
  if (rule == StepRule::midpoint)
    step = [](const Scene& scene, bool dense) { return gauss_lobatto_step(1, scene, dense); };
  registry.add(
      {std::string("type1/") + name(rule), GeneratingType::one, order, order == 2, rule, std::move(summary),
       std::move(adjoint), 0, true},
      [rule](const Scene& scene) { return quadrature_lagrangian(scene.lagrangian, rule); }, std::move(step),
      rule == StepRule::midpoint ? 1 : 0);
}

/// "typeN/word(inner)" taken apart.
struct Transform {
  GeneratingType type;
  std::string word;
  std::string inner;
};

/// N of "typeN/…", which is taken off; none where the name does not begin so with N from 1 to `most`.
std::optional<int> take_type(std::string_view& name, int most) {
  const int type = name.starts_with("type") && name.size() > 5 && name[5] == '/' ? name[4] - '0' : 0;
  if (type < 1 || type > most) return std::nullopt;
  name.remove_prefix(6);
  return type;
}

bool parse_transform(std::string_view name, Transform& transform) {
  const auto type = take_type(name, 4);
  if (!type || !name.ends_with(')')) return false;
  const auto bracket = name.find('(');
  const std::string_view word = name.substr(0, bracket);
  if (bracket + 2 >= name.size() || (word != "legendre" && word != "adjoint")) return false;
  const std::string_view inner = name.substr(bracket + 1, name.size() - bracket - 2);
  transform = {static_cast<GeneratingType>(*type), std::string(word), std::string(inner)};
  return true;
}

/// "typeN/gl:S", N = 1, 2, 3.
std::optional<Method> gauss_lobatto_method(const std::string& name) {
  std::string_view stages = name;
  const auto type = take_type(stages, 3);
  if (!type || !stages.starts_with("gl:")) return std::nullopt;
  stages.remove_prefix(3);
  if (stages.empty() || stages.size() > 4 || stages.find_first_not_of("0123456789") != stages.npos)
    return std::nullopt;
  const int s = std::stoi(std::string(stages));
  gauss_lobatto_tableau(s);  // throws for a number of stages that is not allowed
  const MethodInfo info{name,
                        static_cast<GeneratingType>(*type),
                        2 * s,
                        true,
                        StepRule::midpoint,
                        "Gauss-Lobatto Dirac step, " + std::to_string(s) + (s == 1 ? " stage" : " stages")};
  return Method{
      info,
      [s, type = info.type](const Scene& scene) { return gauss_lobatto_function(type, s, scene.lagrangian); },
      [s](const Scene& scene, bool dense) { return gauss_lobatto_step(s, scene, dense); }, s, true};
}

}  // namespace

std::unique_ptr<StepProblem> Method::step(const Scene& scene, bool dense, std::optional<ConstraintRule> rule,
                                          bool force_degenerate) const {
  if (scene.lagrangian->structure().phase_space() && !force_degenerate) {
    if (stages > 0) return phase_space_step(stages, scene, dense);
    throw Misuse("scene '" + scene.name + "': its Lagrangian is linear in v, where '" + info.name +
                 "' is unstable or leaves p = ∂L/∂v; use type1/midpoint or typeN/gl:S");
  }
  const bool stated_rule = !rule || (!rule->own && rule->nodes == info.constraint_rule);
  if (make_step && stated_rule) return make_step(scene, dense);
  ConstraintRule applied = info.constraint_rule;
  if (rule && rule->own) applied.own = rule->own;  // forces keep the method's nodes
  if (rule && !rule->own) applied.nodes = rule->nodes;
  if (make && !rows_inside) return dirac_step(make(scene), scene, applied, dense);
  throw Misuse("method '" + info.name + "' has its own nodes for the constraint; no other rule applies");
}

Registry Registry::with_built_ins() {
  Registry registry;
  add_quadrature(registry, StepRule::left, 1, "L_d = h L(q0, (q1-q0)/h)", "type1/right");
  add_quadrature(registry, StepRule::right, 1, "L_d = h L(q1, (q1-q0)/h)", "type1/left");
  add_quadrature(registry, StepRule::midpoint, 2, "L_d = h L((q0+q1)/2, (q1-q0)/h)");
  add_quadrature(registry, StepRule::trapezoidal, 2, "L_d = h/2 [L(q0, (q1-q0)/h) + L(q1, (q1-q0)/h)]");
  registry.add({"type2/euler", GeneratingType::two, 1, false, StepRule::left, "H_d+ = p1 q0 + h H(q0, p1)",
                "type3/euler"},
               [](const Scene& scene) { return euler_type2(hamiltonian_of(scene)); });
  registry.add({"type3/euler", GeneratingType::three, 1, false, StepRule::right,
                "H_d- = -p0 q1 + h H(q1, p0)", "type2/euler"},
               [](const Scene& scene) { return euler_type3(hamiltonian_of(scene)); });
  return registry;
}

void Registry::add(MethodInfo info, GeneratingFunctionFactory make, StepFactory make_step, int stages) {
  const std::string name = info.name;
  const std::string prefix = prefix_of(info.type);
  const bool well_formed = name.starts_with(prefix) && name.size() > prefix.size() &&
                           name.find_first_not_of(letters, prefix.size()) == name.npos;
  if (!well_formed) throw Misuse("method name '" + name + "' is not of the form " + prefix + "construction");
  if (!methods_.emplace(name, Method{std::move(info), std::move(make), std::move(make_step), stages}).second)
    throw Misuse("method '" + name + "' is already registered");
}

Method Registry::method(const std::string& name) const {
  if (name.size() > longest_name)
    throw Misuse("a method's name of " + std::to_string(name.size()) + " characters; up to " +
                 std::to_string(longest_name) + " are read");
  const auto found = methods_.find(name);
  if (found != methods_.end()) return found->second;
  if (const auto gauss_lobatto = gauss_lobatto_method(name)) return *gauss_lobatto;
  return transformed(name);
}

void Registry::add_rule(const StepRule& rule) {
  if (std::ranges::find(rules_, rule.name(), &StepRule::name) != rules_.end())
    throw Misuse("constraint rule '" + name(rule) + "' is already registered");
  rules_.push_back(rule);
}

StepRule Registry::rule(std::string_view wanted) const {
  const auto found = std::ranges::find(rules_, wanted, &StepRule::name);
  if (found != rules_.end()) return *found;
  std::string message = "unknown constraint rule '";
  message.append(wanted).append("'; the rules are");
  for (const StepRule& known : rules_) message.append(" ").append(name(known));
  throw Misuse(message);
}

Method Registry::transformed(const std::string& name) const {
  Transform transform;
  if (!parse_transform(name, transform)) {
    std::string message = "unknown method '" + name + "'; the methods are";
    for (const std::string& known : names()) message += " " + known;
    throw Misuse(message + " typeN/gl:S typeN/adjoint(...)");
  }
  const Method inner = method(transform.inner);
  if (!inner.make || inner.rows_inside)
    throw Misuse(
        "'" + name + "': " + transform.inner +
        " keeps the rows at nodes inside the step, so no function of its end points makes it; typeN/gl:S "
        "are its transforms, and it is its own adjoint");
  MethodInfo info = inner.info;
  info.name = name;
  info.type = transform.type;
  info.adjoint.clear();
  if (transform.word == "legendre") {
    if (inner.info.type != GeneratingType::one || transform.type == GeneratingType::one)
      throw Misuse("'" + name + "': the discrete Legendre transform leads from type 1 to types 2, 3 and 4");
    info.summary = "discrete Legendre transform of " + transform.inner;
    return {info,
            [inner, type = transform.type](const Scene& scene) { return legendre(type, inner.make(scene)); }};
  }
  if (transform.type != adjoint_type(inner.info.type))
    throw Misuse("'" + name + "': the adjoint is of another type; use " +
                 prefix_of(adjoint_type(inner.info.type)) + "adjoint(" + transform.inner + ")");
  info.summary = "adjoint of " + transform.inner;
  info.constraint_rule = mirrored(inner.info.constraint_rule);
  return {info, [inner](const Scene& scene) { return adjoint(inner.make(scene)); }};
}

Method Registry::adjoint_of(const Method& original) const {
  if (original.info.self_adjoint) return original;
  if (!original.info.adjoint.empty()) return method(original.info.adjoint);
  return method(prefix_of(adjoint_type(original.info.type)) + "adjoint(" + original.info.name + ")");
}

std::vector<std::string> Registry::names() const {
  std::vector<std::string> names;
  for (const auto& [name, method] : methods_) names.push_back(name);
  for (const char* type : {"type2", "type3", "type4"})
    for (const auto& [name, method] : methods_)
      if (method.info.type == GeneratingType::one)
        names.push_back(std::string(type) + "/legendre(" + name + ")");
  for (const char* type : {"type1", "type2", "type3"})
    for (const char* stages : {"1", "2", "3", "4"}) names.push_back(std::string(type) + "/gl:" + stages);
  return names;
}

}  // namespace diracstep
