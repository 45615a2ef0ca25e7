#include <diracstep/core/errors.hpp>
#include <diracstep/core/generating_functions/quadrature.hpp>
#include <diracstep/core/registry.hpp>
#include <regex>

namespace diracstep {

Registry Registry::with_built_ins() {
  Registry registry;
  registry.add({"type1/midpoint", GeneratingType::one, 2, true, StepRule::midpoint,
                "L_d = h L((q0+q1)/2, (q1-q0)/h)"},
               [](const Scene& scene) { return quadrature_lagrangian(scene.lagrangian, StepRule::midpoint); });
  return registry;
}

void Registry::add(MethodInfo info, GeneratingFunctionFactory factory) {
  if (!std::regex_match(info.name, std::regex("type[1-4]/[A-Za-z0-9_:()/.-]+")))
    throw Misuse("method name '" + info.name + "' is not of the form typeN/construction with N = 1, 2, 3, 4");
  const std::string name = info.name;
  if (!entries_.emplace(name, Entry{std::move(info), std::move(factory)}).second)
    throw Misuse("method '" + name + "' is already registered");
}

const Registry::Entry& Registry::find(const std::string& name) const {
  const auto found = entries_.find(name);
  if (found != entries_.end()) return found->second;
  std::string message = "unknown method '" + name + "'; the methods are";
  for (const auto& [known, entry] : entries_) message += " " + known;
  throw Misuse(message);
}

const MethodInfo& Registry::info(const std::string& name) const { return find(name).info; }

std::unique_ptr<GeneratingFunction> Registry::make(const std::string& name, const Scene& scene) const {
  return find(name).factory(scene);
}

std::vector<std::string> Registry::names() const {
  std::vector<std::string> names;
  for (const auto& [name, entry] : entries_) names.push_back(name);
  return names;
}

}  // namespace diracstep
