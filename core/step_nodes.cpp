#include <array>
#include <diracstep/core/step_nodes.hpp>

namespace diracstep {

namespace {

struct NamedRule {
  const char* name;
  std::array<StepNode, 2> nodes;
  std::size_t size;
};

const NamedRule& rule_data(StepRule rule) {
  static constexpr std::array<NamedRule, 4> rules{{
      {"left", {{{0.0, 1.0}}}, 1},
      {"right", {{{1.0, 1.0}}}, 1},
      {"midpoint", {{{0.5, 1.0}}}, 1},
      {"trapezoidal", {{{0.0, 0.5}, {1.0, 0.5}}}, 2},
  }};
  return rules.at(static_cast<std::size_t>(rule));
}

}  // namespace

std::span<const StepNode> step_nodes(StepRule rule) {
  const NamedRule& data = rule_data(rule);
  return {data.nodes.data(), data.size};
}

StepRule mirrored(StepRule rule) {
  if (rule == StepRule::left) return StepRule::right;
  if (rule == StepRule::right) return StepRule::left;
  return rule;
}

const char* name(StepRule rule) { return rule_data(rule).name; }

}  // namespace diracstep
