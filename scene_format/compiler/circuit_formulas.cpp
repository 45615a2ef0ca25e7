#include <fmt/format.h>

#include <algorithm>
#include <diracstep/constraints/kirchhoff.hpp>
#include <diracstep/scene_format/compiler/circuit_formulas.hpp>

namespace diracstep::scene_compiler {

Node CircuitFormulas::coordinate(const std::string& branch, Place place, Role role) {
  const auto family = std::ranges::find(symbols_.families, "q" + branch, &Symbols::Family::name);
  if (family == symbols_.families.end())
    throw SceneError(document_.file, place, fmt::format("there is no branch '{}'", branch));
  return graph_.coordinate(static_cast<int>(family - symbols_.families.begin()), none, role);
}

Node CircuitFormulas::value(const FormulaText& text, const std::string& what) {
  return parser_.formula(text, {.what = what, .time = true});
}

Node CircuitFormulas::lagrangian() {
  Node sum = graph_.number(0.0);
  const Node half = graph_.number(0.5);
  for (const auto& branch : document_.branches) {
    const Node q = coordinate(branch.name, branch.place, Role::position);
    const Node i = coordinate(branch.name, branch.place, Role::second);
    const Node size = value(branch.value, branch.kind + ' ' + branch.name);
    if (branch.kind == "inductor")
      sum = graph_.add(sum, graph_.multiply(graph_.multiply(half, size), graph_.power(i, 2)));
    else if (branch.kind == "capacitor")
      sum = graph_.subtract(sum, graph_.multiply(graph_.divide(half, size), graph_.power(q, 2)));
    else if (branch.kind == "source_voltage")
      sum = graph_.add(sum, graph_.multiply(size, q));
  }
  for (const auto& mutual : document_.mutuals) {
    const Node first = coordinate(mutual.first, mutual.place, Role::second);
    const Node second = coordinate(mutual.second, mutual.place, Role::second);
    const Node size = value(mutual.value, "a mutual inductance");
    sum = graph_.add(sum, graph_.multiply(size, graph_.multiply(first, second)));
  }
  return sum;
}

Node CircuitFormulas::dissipation() {
  Node sum = graph_.number(0.0);
  for (const auto& branch : document_.branches) {
    if (branch.kind != "resistor") continue;
    const Node i = coordinate(branch.name, branch.place, Role::second);
    const Node size = value(branch.value, "resistor " + branch.name);
    sum = graph_.add(sum, graph_.multiply(graph_.multiply(graph_.number(0.5), size), graph_.power(i, 2)));
  }
  return sum;
}

std::vector<std::pair<std::string, Node>> CircuitFormulas::current_laws() {
  std::vector<std::pair<std::string, std::string>> ends;
  for (const auto& branch : document_.branches) ends.emplace_back(branch.from, branch.to);
  std::vector<std::pair<std::string, Node>> laws;
  for (const std::string& node : nodes_with_rows(ends)) {
    Node sum = graph_.number(0.0);
    for (const auto& branch : document_.branches) {
      const Node i = coordinate(branch.name, branch.place, Role::second);
      if (branch.from == node) sum = graph_.add(sum, i);
      if (branch.to == node) sum = graph_.subtract(sum, i);
    }
    laws.emplace_back(node, sum);
  }
  return laws;
}

}  // namespace diracstep::scene_compiler
