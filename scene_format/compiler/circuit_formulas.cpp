#include <fmt/format.h>

#include <algorithm>
#include <diracstep/constraints/kirchhoff.hpp>
#include <diracstep/scene_format/compiler/circuit_formulas.hpp>
#include <string>
#include <unordered_map>
#include <vector>

namespace diracstep::scene_compiler {

Node CircuitFormulas::coordinate(const std::string& branch, Place place, Role role) {
  const int family = symbols_.family("q" + branch);
  if (family == none) throw SceneError(document_.file, place, fmt::format("there is no branch '{}'", branch));
  return graph_.coordinate(family, none, role);
}

Node CircuitFormulas::value(const FormulaText& text, const std::string& what) {
  return parser_.formula(text, {.what = what, .time = true, .mechanics = true});
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
  std::unordered_map<std::string, std::vector<const SceneDocument::Branch*>> at;  // each node, in file order
  for (const auto& branch : document_.branches)
    for (const std::string* end : {&branch.from, &branch.to}) at[*end].push_back(&branch);
  std::vector<std::pair<std::string, Node>> laws;
  for (const std::string& node : nodes_with_rows(ends)) {
    Node sum = graph_.number(0.0);
    for (const SceneDocument::Branch* branch : at[node]) {
      const Node i = coordinate(branch->name, branch->place, Role::second);
      if (branch->from == node) sum = graph_.add(sum, i);
      if (branch->to == node) sum = graph_.subtract(sum, i);
    }
    laws.emplace_back(node, sum);
  }
  return laws;
}

}  // namespace diracstep::scene_compiler
