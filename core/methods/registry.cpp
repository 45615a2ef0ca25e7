#include <algorithm>
#include <diracstep/core/methods/adjoint.hpp>
#include <diracstep/core/methods/euler.hpp>
#include <diracstep/core/methods/group_methods.hpp>
#include <diracstep/core/methods/legendre.hpp>
#include <diracstep/core/methods/quadrature.hpp>
#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/names.hpp>
#include <optional>
#include <utility>

namespace diracstep {

namespace {

constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_:.-";
/// A name may hold names, which are read by recursion.
constexpr std::size_t longest_name = 1000;

void add_with_groups(Registry& registry, MethodInfo info, GeneratingFunctionFactory generating_function) {
  Method method = method_of(std::move(info), std::move(generating_function));
  method.make_step = with_group_step(method.info, std::move(method.make_step));
  registry.add(std::move(method));
}

void add_quadrature(Registry& registry, StepRule rule, int order, std::string summary,
                    std::string adjoint = {}) {
  add_with_groups(registry,
                  {std::string("type1/") + name(rule), GeneratingType::one, order, false, rule,
                   std::move(summary), std::move(adjoint), 0, true},
                  [rule](const Scene& scene) { return quadrature_lagrangian(lagrangian_of(scene), rule); });
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

/// The method without transforms that steps a configuration space of its own as the transform of this name
/// does: there a Legendre transform steps as what it transforms, and two adjoints cancel.  Nothing where an
/// adjoint is asked for that has no name.
std::optional<Method> stepped_as_on_group(const Registry& registry, const std::string& name) {
  bool adjoint = false;
  std::string inner = name;
  for (Transform transform; parse_transform(inner, transform); inner = transform.inner)
    if (transform.word == "adjoint") adjoint = !adjoint;
  Method original = registry.method(inner);
  if (!adjoint || original.info.self_adjoint) return original;
  if (original.info.adjoint.empty()) return std::nullopt;
  return registry.method(original.info.adjoint);
}

/// "typeN/gl:S", N = 1, 2, 3.
std::optional<Method> read_gauss_lobatto(std::string_view name) {
  const auto type = take_type(name, 3);
  if (!type || !name.starts_with("gl:")) return std::nullopt;
  name.remove_prefix(3);
  if (name.empty() || name.size() > 4 || name.find_first_not_of("0123456789") != name.npos)
    return std::nullopt;
  return gauss_lobatto_method(static_cast<GeneratingType>(*type), std::stoi(std::string(name)));
}

constexpr std::string_view radau_prefix = "damped/radau:";

/// "damped/radau:S".
std::optional<Method> read_radau(std::string_view name) {
  if (!name.starts_with(radau_prefix)) return std::nullopt;
  name.remove_prefix(radau_prefix.size());
  if (name.empty() || name.size() > 4 || name.find_first_not_of("0123456789") != name.npos)
    return std::nullopt;
  return radau_method(std::stoi(std::string(name)));
}

}  // namespace

Registry Registry::with_built_ins() {
  Registry registry;
  add_quadrature(registry, StepRule::left, 1, "L_d = h L(q0, (q1-q0)/h)", "type1/right");
  add_quadrature(registry, StepRule::right, 1, "L_d = h L(q1, (q1-q0)/h)", "type1/left");
  registry.add(midpoint_method());
  registry.add(trapezoidal_method());
  // Where there is a Lagrangian, the Legendre transforms of type1/left and type1/right.
  add_with_groups(registry,
                  {"type2/euler", GeneratingType::two, 1, false, StepRule::left, "H_d+ = p1 q0 + h H(q0, p1)",
                   "type3/euler"},
                  [](const Scene& scene) { return euler_type2(hamiltonian_of(scene)); });
  add_with_groups(registry,
                  {"type3/euler", GeneratingType::three, 1, false, StepRule::right,
                   "H_d- = -p0 q1 + h H(q1, p0)", "type2/euler"},
                  [](const Scene& scene) { return euler_type3(hamiltonian_of(scene)); });
  return registry;
}

void Registry::add(Method method) {
  const std::string name = method.info.name;
  if (!method.info.type) throw Misuse("method '" + name + "' has no type of a generating function");
  const std::string prefix = prefix_of(*method.info.type);
  const bool well_formed = name.starts_with(prefix) && name.size() > prefix.size() &&
                           name.find_first_not_of(letters, prefix.size()) == name.npos;
  if (!well_formed) throw Misuse("method name '" + name + "' is not of the form " + prefix + "construction");
  if (methods_.contains(name)) throw Misuse("method '" + name + "' is already registered");
  if (!method.make_step) throw Misuse("method '" + name + "' has neither a generating function nor a step");
  methods_.emplace(name, std::move(method));
}

void Registry::add(MethodInfo info, GeneratingFunctionFactory generating_function) {
  add(generating_function ? method_of(std::move(info), std::move(generating_function))
                          : Method{std::move(info), nullptr});
}

Method Registry::method(const std::string& name) const {
  if (name.size() > longest_name)
    throw Misuse("a method's name of " + std::to_string(name.size()) + " characters; up to " +
                 std::to_string(longest_name) + " are read");
  const auto found = methods_.find(name);
  if (found != methods_.end()) return found->second;
  if (auto gauss_lobatto = read_gauss_lobatto(name)) return *std::move(gauss_lobatto);
  if (auto radau = read_radau(name)) return *std::move(radau);
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
  std::vector<std::string> names;
  for (const StepRule& known : rules_) names.emplace_back(name(known));
  std::string message = "unknown constraint rule '";
  message.append(wanted).append("'").append(did_you_mean(wanted, names)).append("; the rules are");
  for (const std::string& known : names) message.append(" ").append(known);
  throw Misuse(message);
}

Method Registry::transformed(const std::string& name) const {
  Transform transform;
  if (!parse_transform(name, transform)) {
    const std::vector<std::string> known = names();
    std::string message = "unknown method '" + name + "'" + did_you_mean(name, known) + "; the methods are";
    for (const std::string& each : known) message += " " + each;
    throw Misuse(message + " typeN/gl:S typeN/adjoint(...) damped/radau:S");
  }
  const Method inner = method(transform.inner);
  if (inner.info.damped)
    throw Misuse("'" + name + "': " + transform.inner + " has no generating function to transform");
  if (!inner.generating_function || inner.info.rows_inside)
    throw Misuse(
        "'" + name + "': " + transform.inner +
        " keeps the rows at nodes inside the step, so no function of its end points makes it; typeN/gl:S "
        "are its transforms, and it is its own adjoint");
  MethodInfo info = inner.info;
  info.name = name;
  info.type = transform.type;
  info.adjoint.clear();
  info.stages = 0;
  info.solved_as.clear();
  if (transform.word == "legendre") {
    if (inner.info.type != GeneratingType::one || transform.type == GeneratingType::one)
      throw Misuse("'" + name + "': the discrete Legendre transform leads from type 1 to types 2, 3 and 4");
    info.summary = "discrete Legendre transform of " + transform.inner;
    Method made = method_of(info, [s = inner.generating_function, type = transform.type](const Scene& scene) {
      return legendre(type, s(scene));
    });
    made.make_step = with_group_step_of(info, std::move(made.make_step), inner.make_step);
    return made;
  }
  if (const GeneratingType type = adjoint_type(*inner.info.type); transform.type != type)
    throw Misuse("'" + name + "': the adjoint is of another type; use " + prefix_of(type) + "adjoint(" +
                 transform.inner + ")");
  info.summary = "adjoint of " + transform.inner;
  info.constraint_rule = mirrored(inner.info.constraint_rule);
  Method made =
      method_of(info, [s = inner.generating_function](const Scene& scene) { return adjoint(s(scene)); });
  if (auto on_group = stepped_as_on_group(*this, name))
    made.make_step = with_group_step_of(info, std::move(made.make_step), std::move(on_group->make_step));
  return made;
}

Method Registry::adjoint_of(const Method& original) const {
  if (original.info.self_adjoint) return original;
  if (!original.info.adjoint.empty()) return method(original.info.adjoint);
  if (!original.info.type) throw Misuse("method '" + original.info.name + "' has no adjoint");
  return method(prefix_of(adjoint_type(*original.info.type)) + "adjoint(" + original.info.name + ")");
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
  for (const char* stages : {"1", "2", "3", "4"}) names.push_back(std::string(radau_prefix) + stages);
  return names;
}

}  // namespace diracstep
