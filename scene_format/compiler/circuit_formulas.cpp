#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/circuit_formulas.hpp>
#include <diracstep/scene_format/compiler/circuit_reader.hpp>
#include <string>
#include <vector>

namespace diracstep::scene_compiler {

namespace {

constexpr double usual_capacitance = 1e-12;        // F, of a diode
constexpr double least_conductance = 1e-12;        // A/V, of a diode without capacitance; SPICE's GMIN
constexpr double usual_breakdown = 1e-3;           // A, SPICE's IBV
constexpr double usual_thermal_voltage = 0.02585;  // V, kT/e at 300 K

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
    const Node thermal = value_or(branch, index, "thermal_voltage", usual_thermal_voltage);
    Node own = graph_.multiply(
        value(branch, index, "saturation"),
        graph_.subtract(graph_.apply(Op::exp, graph_.divide(u, thermal)), graph_.number(1.0)));
    if (branch.has("breakdown_voltage")) {  // − I_b exp(−(u + u_b)/u_T)
      const Node beyond = graph_.negative(graph_.add(u, value(branch, index, "breakdown_voltage")));
      own =
          graph_.subtract(own, graph_.multiply(value_or(branch, index, "breakdown_current", usual_breakdown),
                                               graph_.apply(Op::exp, graph_.divide(beyond, thermal))));
    }
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

}  // namespace diracstep::scene_compiler
