/// Kirchhoff's current law in CircuitFormulas: a row for each node, and for nodes that are repeated.
#include <fmt/format.h>

#include <algorithm>
#include <diracstep/constraints/kirchhoff.hpp>
#include <diracstep/scene_format/compiler/circuit_formulas.hpp>
#include <string>
#include <unordered_map>
#include <vector>

namespace diracstep::scene_compiler {

void CircuitFormulas::add_current_laws(std::vector<Row>& rows) {
  std::vector<std::pair<std::string, std::string>> ends;
  std::unordered_map<std::string, std::vector<const Branch*>> at;  // each node, in file order
  std::set<std::string> repeated;
  for (const auto& branch : document_.branches) {
    ends.emplace_back(branch.from.name, branch.to.name);
    for (const SceneDocument::NodeName* end : {&branch.from, &branch.to}) {
      if (at[end->name].empty() || at[end->name].back() != &branch) at[end->name].push_back(&branch);
      if (end->index) repeated.insert(end->name);
    }
  }
  const std::vector<std::string> with_rows = nodes_with_rows(ends);
  for (const std::string& node : repeated) {
    const Branch& first = *at[node].front();
    if (std::ranges::find(with_rows, node) == with_rows.end())
      fail(first.place,
           fmt::format("nothing joins the nodes {}[…] to 'ground'; repeated nodes need one", node));
    for (const Branch* branch : at[node])
      for (const SceneDocument::NodeName* end : {&branch->from, &branch->to})
        if (end->name == node && !end->index)
          fail(branch->place,
               fmt::format("the node '{}' is repeated elsewhere; here it needs an index", node));
  }
  for (const std::string& node : with_rows) {
    if (repeated.contains(node)) {
      rows.push_back(repeated_law(node));
      continue;
    }
    Node sum = graph_.number(0.0);
    for (const Branch* branch : at[node]) {
      const Node out = total_current(*branch, own_index(*branch));
      if (branch->from.name == node) sum = graph_.add(sum, summed(*branch, out));
      if (branch->to.name == node) sum = graph_.subtract(sum, summed(*branch, out));
    }
    rows.push_back({"node_" + node, "Kirchhoff's current law at node '" + node + "'", {}, sum, {}});
  }
}

/// The row of each node n[j]: over all ends, the branch whose end it is, if there is one.
CircuitFormulas::Row CircuitFormulas::repeated_law(const std::string& name) {
  Node first = none, last = none;
  const auto widen = [&](Node low, Node high) {
    first = first == none ? low : graph_.apply(Op::min, first, low);
    last = last == none ? high : graph_.apply(Op::max, last, high);
  };
  std::vector<std::pair<const Branch*, const SceneDocument::NodeName*>> meeting;
  for (const auto& branch : document_.branches)
    for (const SceneDocument::NodeName* end : {&branch.from, &branch.to}) {
      if (end->name != name) continue;
      meeting.emplace_back(&branch, end);
      const std::vector<int> own = loops(branch);
      if (own.empty()) {
        widen(node_index(branch, *end, none), node_index(branch, *end, none));
        continue;
      }
      const Loop range = symbols_.loops[static_cast<std::size_t>(own.front())];
      widen(graph_.add(range.first, shift(branch, *end)), graph_.add(range.last, shift(branch, *end)));
    }
  symbols_.loops.push_back({"node", first, last});
  const int loop = static_cast<int>(symbols_.loops.size()) - 1;
  Node sum = graph_.number(0.0);
  for (const auto& [branch, end] : meeting) {
    const Node flow = inflow(*branch, *end, graph_.loop_index(loop));
    sum = end == &branch->from ? graph_.add(sum, flow) : graph_.subtract(sum, flow);
  }
  return {"node_" + name, "Kirchhoff's current law at the nodes " + name + "[…]", {loop}, sum, {}};
}

/// Σ of the current over the one turn of the branch whose end is the node, over none where there is no such.
Node CircuitFormulas::inflow(const Branch& branch, const SceneDocument::NodeName& node, Node at) {
  const std::vector<int> own = loops(branch);
  Loop only;
  if (own.empty()) {
    const Node here = node_index(branch, node, none);
    only = {"k", graph_.apply(Op::max, at, here), graph_.apply(Op::min, at, here)};
  } else {
    const Loop range = symbols_.loops[static_cast<std::size_t>(own.front())];
    const Node turn = graph_.subtract(at, shift(branch, node));
    only = {"k", graph_.apply(Op::max, range.first, turn), graph_.apply(Op::min, range.last, turn)};
  }
  symbols_.loops.push_back(only);
  const int loop = static_cast<int>(symbols_.loops.size()) - 1;
  return graph_.sum(total_current(branch, own.empty() ? none : graph_.loop_index(loop)), loop);
}

/// c of an end "n[k + c]".
Node CircuitFormulas::shift(const Branch& branch, const SceneDocument::NodeName& node) {
  if (!node.index)
    fail(branch.place, fmt::format("the node '{}' is repeated elsewhere; here it needs an index", node.name));
  const Node zero = graph_.number(0.0), turn = own_index(branch);
  const Node here = node_index(branch, node, turn);
  const Node c = node_index(branch, node, zero);
  if (graph_.add(turn, c) != here && graph_.subtract(turn, graph_.negative(c)) != here)
    fail(node.index->start,
         fmt::format("the index of the node '{}' is {}; expected the loop variable, plus or "
                     "minus what does not depend on it, as in n[k-1]",
                     node.name, node.index->text));
  return c;
}

Node CircuitFormulas::node_index(const Branch& branch, const SceneDocument::NodeName& node, Node index) {
  return parser_.index(*node.index, context(branch, index, "nodes", false));
}

}  // namespace diracstep::scene_compiler
