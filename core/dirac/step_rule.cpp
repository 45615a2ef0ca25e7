#include <cmath>
#include <diracstep/core/dirac/step_rule.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <sstream>

namespace diracstep {

namespace {

std::string fault_of(std::string_view name, const std::vector<StepNode>& nodes) {
  std::ostringstream text;
  if (name.empty() || name.size() > StepRule::longest_name)
    text << "its name has " << name.size() << " characters; 1 to " << StepRule::longest_name
         << " are allowed";
  if (nodes.empty() || nodes.size() > StepRule::max_nodes)
    text << "it has " << nodes.size() << " nodes; 1 to " << StepRule::max_nodes << " are allowed";
  double sum = 0.0;
  for (const StepNode& node : nodes) {
    if (!(node.c >= 0.0 && node.c <= 1.0)) text << "a node is " << node.c << "; nodes lie in [0, 1]";
    sum += node.weight;
  }
  if (!(std::abs(sum - 1.0) <= 1e-12)) text << "its weights add up to " << sum << "; they must add up to 1";
  return text.str();
}

}  // namespace

StepRule step_rule(std::string_view name, const std::vector<StepNode>& nodes) {
  const std::string fault = fault_of(name, nodes);
  if (!fault.empty()) throw Misuse("constraint rule '" + std::string(name) + "': " + fault);
  StepRule rule(name, {});
  std::copy(nodes.begin(), nodes.end(), rule.nodes_.begin());
  rule.size_ = nodes.size();
  return rule;
}

StepRule mirrored(const StepRule& rule) {
  if (rule == StepRule::left) return StepRule::right;
  if (rule == StepRule::right) return StepRule::left;
  std::vector<StepNode> nodes;
  for (const StepNode& node : rule.nodes()) nodes.insert(nodes.begin(), {1.0 - node.c, node.weight});
  if (std::ranges::equal(nodes, rule.nodes())) return rule;
  constexpr std::string_view prefix = "mirrored ";
  const std::string_view plain = rule.name();
  if (plain.starts_with(prefix)) return step_rule(plain.substr(prefix.size()), nodes);
  return step_rule((std::string(prefix) + std::string(plain)).substr(0, StepRule::longest_name), nodes);
}

}  // namespace diracstep
