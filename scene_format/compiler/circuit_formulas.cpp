#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <diracstep/constraints/kirchhoff.hpp>
#include <diracstep/scene_format/compiler/circuit_formulas.hpp>
#include <diracstep/scene_format/compiler/circuit_reader.hpp>
#include <string>
#include <unordered_map>
#include <vector>

namespace diracstep::scene_compiler {

namespace {

constexpr double usual_capacitance = 1e-12;        // F, of a diode
constexpr double least_conductance = 1e-12;        // A/V, of a diode without capacitance; SPICE's GMIN
constexpr double usual_thermal_voltage = 0.02585;  // V, kT/e at 300 K
constexpr std::size_t most_nodes_on_paths = 300;

}  // namespace

CircuitFormulas::CircuitFormulas(SceneDocument& document, FormulaGraph& graph, Symbols& symbols,
                                 FormulaParser& parser)
    : document_(document), graph_(graph), symbols_(symbols), parser_(parser) {
  if (document.branches.empty()) return;
  parser_.set_circuit([this](const CircuitQuery& query) { return answer(query); });
}

void CircuitFormulas::fail(Place place, const std::string& message) const {
  throw SceneError(document_.file, place, message);
}

const SceneDocument::Branch& CircuitFormulas::branch(const std::string& name, Place place) const {
  const auto found = std::ranges::find(document_.branches, name, &Branch::name);
  if (found != document_.branches.end()) return *found;
  std::vector<std::string> names;
  for (const auto& other : document_.branches) names.push_back(other.name);
  fail(place, fmt::format("there is no branch '{}'{}", name, suggestion(name, names)));
}

// Charges, currents and values.  An index is that of a repeated branch, and none for a single one.

std::vector<int> CircuitFormulas::loops(const Branch& branch) const {
  return symbols_.families[static_cast<std::size_t>(family("q" + branch.name))].loops;
}

Node CircuitFormulas::own_index(const Branch& branch) {
  const std::vector<int> own = loops(branch);
  if (own.size() > 1) fail(branch.place, "branches are repeated over one loop, no more");
  return own.empty() ? none : graph_.loop_index(own.front());
}

Node CircuitFormulas::charge(const Branch& branch, Node index) {
  return graph_.coordinate(family("q" + branch.name), index, Role::position);
}

Node CircuitFormulas::current(const Branch& branch, Node index) {
  return graph_.coordinate(family("q" + branch.name), index, Role::second);
}

/// With that into the capacitance beside it.
Node CircuitFormulas::total_current(const Branch& branch, Node index) {
  const int beside = family("q" + branch.name + "_c");
  const Node own = current(branch, index);
  return beside == none ? own : graph_.add(own, graph_.coordinate(beside, index, Role::second));
}

Node CircuitFormulas::stored_charge(const Branch& branch, Node index) {
  return graph_.coordinate(family("q" + branch.name + "_c"), index, Role::position);
}

/// `motion`: charges and currents may stand in it.
Context CircuitFormulas::context(const Branch& branch, Node index, const std::string& key,
                                 bool motion) const {
  Context context{
      .what = fmt::format("'{}' of {} {}", key, branch.kind, branch.name), .time = true, .mechanics = true};
  if (motion) {
    context.positions = true;
    context.second = 'v';
  }
  const std::vector<int> own = loops(branch);
  if (own.empty()) return context;
  context.locals.emplace(symbols_.loops[static_cast<std::size_t>(own.front())].variable, index);
  if (graph_[index].op == Op::loop_index) context.loops = {graph_[index].a};
  return context;
}

Node CircuitFormulas::value(const Branch& branch, Node index, const std::string& key, bool motion) {
  return parser_.formula(branch.values.find(key)->second, context(branch, index, key, motion));
}

Node CircuitFormulas::value_or(const Branch& branch, Node index, const std::string& key, double absent) {
  return branch.has(key) ? value(branch, index, key) : graph_.number(absent);
}

/// Of resistors and switches; none where there is no such number.
Node CircuitFormulas::resistance(const Branch& branch, Node index) {
  if (branch.kind == "resistor" && branch.has("value")) return value(branch, index, "value");
  if (branch.kind != "switch") return none;
  FormulaText choice = branch.values.find("closed")->second;
  constexpr std::string_view opening = "if(";
  choice.start.column -= static_cast<int>(opening.size());
  choice.text = fmt::format("{}{}, closed_resistance, open_resistance)", opening, choice.text);
  Context where = context(branch, index, "closed", true);
  where.locals.emplace("closed_resistance", value(branch, index, "on"));
  where.locals.emplace("open_resistance", value(branch, index, "off"));
  return parser_.formula(choice, where);
}

Node CircuitFormulas::capacitance(const Branch& branch, Node index) {
  return value_or(branch, index, "capacitance", usual_capacitance);
}

/// Of capacitors, and of those beside diodes.
Node CircuitFormulas::capacitor_energy(const Branch& branch, Node index) {
  if (branch.has("energy")) {
    Context where = context(branch, index, "energy", true);
    where.locals.emplace("q", charge(branch, index));
    return parser_.formula(branch.values.find("energy")->second, where);
  }
  const bool own = branch.kind == "capacitor";
  const Node size = own ? value(branch, index, "value") : capacitance(branch, index);
  const Node q = own ? charge(branch, index) : stored_charge(branch, index);
  return graph_.multiply(graph_.divide(graph_.number(0.5), size), graph_.power(q, 2));
}

/// The current as a function of the voltage u, that of the capacitance beside it or the rate of its flux;
/// none where it is none.
Node CircuitFormulas::conducted(const Branch& branch, Node index) {
  if (!conducts_by_voltage(branch)) return none;
  const Node u = has_flux(branch) ? graph_.coordinate(family("f" + branch.name), index, Role::second)
                                  : graph_.divide(stored_charge(branch, index), capacitance(branch, index));
  if (branch.kind == "resistor") {
    Context where = context(branch, index, "current", true);
    where.locals.emplace("u", u);
    return parser_.formula(branch.values.find("current")->second, where);
  }
  if (branch.has("saturation")) {  // I_s (exp(u/u_T) − 1)
    const Node x = graph_.divide(u, value_or(branch, index, "thermal_voltage", usual_thermal_voltage));
    const Node own = graph_.multiply(value(branch, index, "saturation"),
                                     graph_.subtract(graph_.apply(Op::exp, x), graph_.number(1.0)));
    if (!has_flux(branch)) return own;
    return graph_.add(own, graph_.multiply(graph_.number(least_conductance), u));
  }
  // u/off below the threshold, and with the slope 1/on above it
  const Node threshold = value_or(branch, index, "threshold", 0.0), off = value(branch, index, "off");
  const Node above = graph_.apply(Op::max, graph_.number(0.0), graph_.subtract(u, threshold));
  const Node slopes = graph_.subtract(graph_.divide(graph_.number(1.0), value(branch, index, "on")),
                                      graph_.divide(graph_.number(1.0), off));
  return graph_.add(graph_.divide(u, off), graph_.multiply(slopes, above));
}

Node CircuitFormulas::summed(const Branch& branch, Node term) {
  const std::vector<int> own = loops(branch);
  return own.empty() ? term : graph_.sum(term, own.front());
}

bool CircuitFormulas::holds(Node root, bool velocities_only) const {
  return std::ranges::any_of(graph_.reachable(std::span(&root, 1)), [&](Node node) {
    const NodeData& data = graph_[node];
    return data.op == Op::coordinate && (!velocities_only || data.c == static_cast<int>(Role::second));
  });
}

/// With 0 for all coordinates and velocities: what depends on the time alone.
Node CircuitFormulas::at_rest(Node root) {
  for (const Node leaf : graph_.reachable(std::span(&root, 1)))
    if (graph_[leaf].op == Op::coordinate)
      root = graph_.substitute(std::span(&root, 1), leaf, graph_.number(0.0))[0];
  return root;
}

// The functions of the scene.

void CircuitFormulas::declare() {
  for (const auto& branch : document_.branches) {
    if (branch.kind != "source_current") continue;
    const Node given = source_value(branch, own_index(branch));
    if (!holds(given, true)) continue;
    const std::string name = "f" + branch.name;
    if (family(name) != none)
      fail(branch.place, fmt::format("the name '{}' is that of the flux of {}", name, branch.name));
    document_.coordinates.push_back({name, "V s",
                                     "integral of the voltage across source_current " + branch.name,
                                     branch.loops, false, branch.place});
    symbols_.add(Symbols::Family{name, loops(branch), false});
  }
}

Node CircuitFormulas::lagrangian() {
  Node sum = graph_.number(0.0);
  const Node half = graph_.number(0.5);
  for (const auto& branch : document_.branches) {
    const Node index = own_index(branch);
    if (branch.kind == "inductor") {
      const Node term = graph_.multiply(graph_.multiply(half, value(branch, index, "value")),
                                        graph_.power(current(branch, index), 2));
      sum = graph_.add(sum, summed(branch, term));
    } else if (branch.kind == "capacitor" || family("q" + branch.name + "_c") != none) {
      sum = graph_.subtract(sum, summed(branch, capacitor_energy(branch, index)));
    } else if (branch.kind == "source_voltage") {
      const Node driving = at_rest(source_value(branch, index));
      sum = graph_.add(sum, summed(branch, graph_.multiply(driving, charge(branch, index))));
    } else if (has_flux(branch) && !conducts_by_voltage(branch)) {
      const bool source = branch.kind == "source_current";
      const Node given = at_rest(source ? source_value(branch, index)
                                        : voltage(place_of(branch, branch.minus, index),
                                                  place_of(branch, branch.plus, index), branch.place));
      const Node flux = graph_.coordinate(family("f" + branch.name), index, Role::position);
      sum = graph_.subtract(sum, summed(branch, graph_.multiply(given, flux)));
    }
  }
  for (const auto& mutual : document_.mutuals) {
    const Branch &first = branch(mutual.first, mutual.place), &second = branch(mutual.second, mutual.place);
    if (first.kind != "inductor" || second.kind != "inductor" || &first == &second || first.loops ||
        second.loops)
      fail(mutual.place, fmt::format("[[mutual]] couples two single inductors, and these are {} {} and {} {}",
                                     first.kind, first.name, second.kind, second.name));
    Node size = parser_.formula(mutual.value, {.what = "a mutual inductance", .time = true});
    if (mutual.coefficient)
      size = graph_.multiply(size, graph_.apply(Op::sqrt, graph_.multiply(value(first, none, "value"),
                                                                          value(second, none, "value"))));
    sum =
        graph_.add(sum, graph_.multiply(size, graph_.multiply(current(first, none), current(second, none))));
  }
  return sum;
}

Node CircuitFormulas::dissipation() {
  Node sum = graph_.number(0.0);
  for (const auto& branch : document_.branches) {
    if (branch.kind != "resistor" || !branch.has("value")) continue;
    const Node index = own_index(branch), size = resistance(branch, index);
    const Node term =
        graph_.multiply(graph_.multiply(graph_.number(0.5), size), graph_.power(current(branch, index), 2));
    sum = graph_.add(sum, summed(branch, term));
  }
  return sum;
}

std::vector<CircuitFormulas::ForceOn> CircuitFormulas::forces() {
  std::vector<ForceOn> all;
  const auto add = [&](const Branch& on, const std::string& coordinate, Node force) {
    if (!graph_.is_number(force, 0.0))
      all.push_back(
          {family(coordinate), loops(on), force, on.place, "the law of " + on.kind + ' ' + on.name});
  };
  for (const auto& branch : document_.branches) {
    const std::string q = "q" + branch.name, f = "f" + branch.name;
    const Node index = own_index(branch);
    if (branch.kind == "source_voltage") {
      const Node given = source_value(branch, index);
      add(branch, q, graph_.subtract(given, at_rest(given)));
    } else if (branch.kind == "switch") {
      add(branch, q, graph_.negative(graph_.multiply(resistance(branch, index), current(branch, index))));
    } else if (branch.has("voltage")) {
      Context where = context(branch, index, "voltage", true);
      where.locals.emplace("i", current(branch, index));
      add(branch, q, graph_.negative(parser_.formula(branch.values.find("voltage")->second, where)));
    } else if (has_flux(branch) && conducts_by_voltage(branch)) {
      add(branch, q, graph_.negative(graph_.coordinate(family(f), index, Role::second)));
      add(branch, f, graph_.subtract(current(branch, index), conducted(branch, index)));
    } else if (has_flux(branch)) {
      add(branch, q, graph_.negative(graph_.coordinate(family(f), index, Role::second)));
      const bool source = branch.kind == "source_current";
      const Node given = source ? source_value(branch, index)
                                : voltage(place_of(branch, branch.minus, index),
                                          place_of(branch, branch.plus, index), branch.place);
      const Node moving = graph_.subtract(given, at_rest(given));
      add(branch, f, source ? graph_.subtract(current(branch, index), moving) : graph_.negative(moving));
    }
  }
  for (const auto& port : document_.two_ports) {
    if (port.kind != "gyrator") continue;
    const Branch &first = branch(port.side(1), port.place), &second = branch(port.side(2), port.place);
    const Node r = parser_.formula(port.value, {.what = "gyrator " + port.name, .time = true});
    add(first, "q" + first.name, graph_.multiply(r, current(second, none)));  // u1 = −r i2, u2 = r i1
    add(second, "q" + second.name, graph_.negative(graph_.multiply(r, current(first, none))));
  }
  return all;
}

std::vector<CircuitFormulas::Row> CircuitFormulas::rows() {
  std::vector<Row> rows;
  add_current_laws(rows);
  for (const auto& branch : document_.branches) {
    const Node index = own_index(branch);
    if (has_flux(branch)) continue;
    Node given = conducted(branch, index);
    if (branch.kind == "source_current") given = source_value(branch, index);
    if (given == none) continue;
    if (holds(given, true))
      fail(branch.place, fmt::format("the current of {} {} depends on other currents, which is not supported "
                                     "here; let it depend on the voltage of a capacitor",
                                     branch.kind, branch.name));
    rows.push_back({"current_" + branch.name, fmt::format("the current of {} {}", branch.kind, branch.name),
                    loops(branch), graph_.subtract(current(branch, index), given), branch.place});
  }
  for (const auto& port : document_.two_ports) {
    if (port.kind != "transformer") continue;
    const Node ratio = parser_.formula(port.value, {.what = "transformer " + port.name, .time = true});
    const Node first = current(branch(port.side(1), port.place), none),
               second = current(branch(port.side(2), port.place), none);
    rows.push_back({"ratio_" + port.name,
                    "the currents of transformer " + port.name,
                    {},
                    graph_.add(second, graph_.multiply(ratio, first)),
                    port.place});
  }
  return rows;
}

// Kirchhoff's current law.

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

// Voltages by name.

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
