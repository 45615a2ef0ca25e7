/// What a formula may ask of a circuit, in CircuitFormulas: V(a), V(a, b), I(R1), P(R1).
#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <diracstep/scene_format/compiler/circuit_formulas.hpp>
#include <set>
#include <string>
#include <vector>

namespace diracstep::scene_compiler {

namespace {

constexpr std::size_t most_nodes_on_paths = 300;

}  // namespace

Node CircuitFormulas::answer(const CircuitQuery& query) {
  if (query.quantity == 'V') {
    const At ground{query.names.size() == 2 ? query.names[1] : At{}};
    At to = ground;
    if (to.name.empty())
      for (const auto& branch : document_.branches)
        for (const auto* end : {&branch.from, &branch.to})
          if (end->name == "ground" || end->name == "0") to = {end->name};
    if (to.name.empty())
      fail(query.place, "there is no node 'ground'; ask for a voltage between two nodes, V(a, b)");
    return voltage(query.names[0], to, query.place);
  }
  const auto& [name, index] = query.names[0];
  for (const auto& port : document_.two_ports)
    if (port.name == name)
      fail(query.place,
           fmt::format("{} is a {}; its sides are {} and {}", name, port.kind, port.side(1), port.side(2)));
  const Branch& asked = branch(name, query.place);
  if (loops(asked).empty() != (index == none))
    fail(query.place, index == none ? fmt::format("'{0}' is repeated; give an index, {0}[1]", name)
                                    : fmt::format("'{}' has no index", name));
  const Node through = total_current(asked, index);
  return query.quantity == 'I' ? through : graph_.multiply(element_voltage(asked, index), through);
}

Node CircuitFormulas::element_voltage(const Branch& branch, Node index) {
  const Node own = drop(branch, index, false);
  return own != none ? own
                     : voltage(place_of(branch, branch.from, index), place_of(branch, branch.to, index),
                               branch.place);
}

CircuitFormulas::At CircuitFormulas::place_of(const Branch& branch, const SceneDocument::NodeName& node,
                                              Node index) {
  return {node.name, node.index ? node_index(branch, node, index) : none};
}

/// V(from) − V(to), along elements whose voltage is a function of charges and currents; where there are
/// such, along those that need no currents.
Node CircuitFormulas::voltage(const At& from, const At& to, Place place) {
  for (const At* end : {&from, &to})
    if (std::ranges::none_of(document_.branches, [&](const Branch& branch) {
          return branch.from.name == end->name || branch.to.name == end->name;
        }))
      fail(place, fmt::format("there is no node '{}'", end->name));
  for (const bool positions_only : {true, false})
    if (const Node found = path(from, to, positions_only); found != none) return found;
  fail(place,
       fmt::format("no voltage between '{}' and '{}': inductors, current sources and transformers alone "
                   "join them. The potentials of nodes are the columns lambda_node_… of --out; a "
                   "resistor beside one of these elements gives the voltage a name",
                   from.name, to.name));
}

Node CircuitFormulas::path(const At& from, const At& to, bool positions_only) {
  std::deque<std::pair<At, Node>> open{{from, graph_.number(0.0)}};
  std::set<std::pair<std::string, Node>> met{{from.name, from.index}};
  while (!open.empty() && met.size() < most_nodes_on_paths) {
    const auto [here, sum] = open.front();
    open.pop_front();
    if (here.name == to.name && here.index == to.index) return sum;
    for (const auto& branch : document_.branches)
      for (const bool along : {true, false}) {
        const SceneDocument::NodeName &near = along ? branch.from : branch.to,
                                      &far = along ? branch.to : branch.from;
        if (near.name != here.name || being_asked_.contains(branch.name)) continue;
        const auto [meets, index] = index_at(branch, near, here.index);
        if (!meets) continue;
        const At there = place_of(branch, far, index);
        if (met.contains({there.name, there.index})) continue;
        const Node own = drop(branch, index, positions_only);
        if (own == none) continue;
        met.insert({there.name, there.index});
        open.emplace_back(there, along ? graph_.add(sum, own) : graph_.subtract(sum, own));
      }
  }
  return none;
}

/// Whether an end of a branch is the node, and the turn of the branch with that end.
std::pair<bool, Node> CircuitFormulas::index_at(const Branch& branch, const SceneDocument::NodeName& node,
                                                Node index) {
  if (loops(branch).empty()) return {!node.index || node_index(branch, node, none) == index, none};
  if (!node.index) return {false, none};  // one of many
  return {true, graph_.subtract(index, shift(branch, node))};
}

/// The voltage of a branch from its own law; none where that does not tell it.
Node CircuitFormulas::drop(const Branch& branch, Node index, bool positions_only) {
  if (branch.kind == "capacitor")
    return graph_.derivative(capacitor_energy(branch, index), charge(branch, index));
  if (family("q" + branch.name + "_c") != none)
    return graph_.divide(stored_charge(branch, index), capacitance(branch, index));
  Node own = none;
  being_asked_.insert(branch.name);
  if (branch.kind == "source_voltage") own = graph_.negative(source_value(branch, index));
  if (!positions_only && has_flux(branch))
    own = graph_.coordinate(family("f" + branch.name), index, Role::second);
  if (!positions_only && (branch.kind == "switch" || branch.kind == "resistor")) {
    const Node size = resistance(branch, index);
    if (size != none) {
      own = graph_.multiply(size, current(branch, index));
    } else if (branch.has("voltage")) {
      Context where = context(branch, index, "voltage", true);
      where.locals.emplace("i", current(branch, index));
      own = parser_.formula(branch.values.find("voltage")->second, where);
    }
  }
  being_asked_.erase(branch.name);
  return own != none && positions_only && holds(own, true) ? none : own;
}

}  // namespace diracstep::scene_compiler
