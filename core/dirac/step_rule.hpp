#pragma once

#include <algorithm>
#include <array>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace diracstep {

/// A node c in [0,1] of a step and its weight.
struct StepNode {
  double c;
  double weight;

  bool operator==(const StepNode&) const = default;
};

/// The rules that make a discrete Lagrangian out of L and discrete constraint rows out of one-forms: a name,
/// nodes, and weights that add up to 1.  Left and right are of order 1, midpoint and trapezoidal of order 2;
/// others come from step_rule().
class StepRule {
 public:
  static constexpr std::size_t max_nodes = 8;
  static constexpr std::size_t longest_name = 63;
  static const StepRule left, right, midpoint, trapezoidal;

  std::string_view name() const { return name_.data(); }
  std::span<const StepNode> nodes() const { return {nodes_.data(), size_}; }

  bool operator==(const StepRule&) const = default;

 private:
  constexpr StepRule(std::string_view name, std::initializer_list<StepNode> nodes) : size_(nodes.size()) {
    std::copy(name.begin(), name.end(), name_.begin());
    std::copy(nodes.begin(), nodes.end(), nodes_.begin());
  }
  friend StepRule step_rule(std::string_view name, const std::vector<StepNode>& nodes);

  std::array<char, longest_name + 1> name_{};
  std::array<StepNode, max_nodes> nodes_{};
  std::size_t size_;
};

inline constexpr StepRule StepRule::left{"left", {{0.0, 1.0}}};
inline constexpr StepRule StepRule::right{"right", {{1.0, 1.0}}};
inline constexpr StepRule StepRule::midpoint{"midpoint", {{0.5, 1.0}}};
inline constexpr StepRule StepRule::trapezoidal{"trapezoidal", {{0.0, 0.5}, {1.0, 0.5}}};

/// A rule of one's own.  Throws Misuse unless it has a name of 1 to longest_name characters and 1 to
/// max_nodes nodes in [0,1] whose weights add up to 1; with another sum the discrete constraint would not
/// induce Δ_Q back (Leok and Ohsawa (4.18)).
StepRule step_rule(std::string_view name, const std::vector<StepNode>& nodes);

/// Nodes and weights of a rule, which must outlive them.
inline std::span<const StepNode> step_nodes(const StepRule& rule) { return rule.nodes(); }
std::span<const StepNode> step_nodes(const StepRule&& rule) = delete;

/// The rule of the adjoint step, with c and 1 − c exchanged: left and right change places.
StepRule mirrored(const StepRule& rule);

/// "left", "right", "midpoint", "trapezoidal", or the name it was given.
inline std::string name(const StepRule& rule) { return std::string(rule.name()); }

}  // namespace diracstep
