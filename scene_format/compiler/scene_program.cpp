#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/circuit_formulas.hpp>
#include <diracstep/scene_format/compiler/input_table.hpp>
#include <diracstep/scene_format/compiler/kink_finder.hpp>
#include <diracstep/scene_format/compiler/piece_builder.hpp>
#include <diracstep/scene_format/compiler/scene_program.hpp>
#include <diracstep/scene_format/compiler/sum_terms.hpp>
#include <set>

namespace diracstep::scene_compiler {

namespace {

bool is_velocity(const NodeData& data) {
  return data.op == Op::coordinate && data.c == static_cast<int>(Role::second);
}

class SceneCompiler {
 public:
  explicit SceneCompiler(SceneProgram& program)
      : program_(program),
        document_(program.document),
        graph_(program.graph),
        symbols_(program.symbols),
        parser_(document_.file, graph_, symbols_),
        terms_(document_.file, graph_, symbols_),
        circuit_(document_, graph_, symbols_, parser_),
        builder_(graph_, program.known) {}

  void compile() {
    declare();
    circuit_.declare();
    compile_energies();
    compile_rows();
    compile_force();
    compile_start();
    compile_references();
    compile_invariants();
    for (const auto& output : document_.outputs)
      program_.outputs.push_back(
          {output.name, motion_function(output.formula, "output '" + output.name + "'")});
    if (document_.control && !program_.differentiated.empty()) compile_control(*document_.control);
    for (const auto& event : document_.events) compile_event(event);
    for (const auto& body : document_.bodies) compile_drawn(body);
    write_source();
    program_.kinks = KinkFinder(program_, builder_).find();
  }

 private:
  [[noreturn]] void fail(Place place, const std::string& message) const {
    throw SceneError(document_.file, place, message);
  }

  Context mechanics(const std::string& what, char second, std::vector<int> loops = {}) const {
    return {.what = what,
            .positions = true,
            .second = second,
            .time = true,
            .sums = true,
            .mechanics = true,
            .loops = std::move(loops)};
  }

  void declare() {
    if (document_.coordinates.empty()) fail({}, "the scene has no [coordinates]");
    for (const auto& parameter : document_.parameters)
      symbols_.add(Symbols::Parameter{parameter.name, parameter.array});
    symbols_.definitions = document_.definitions;
    for (const auto& row : document_.rows)
      if (!row.loops) symbols_.rows.push_back(row.name);
    for (const auto& input : document_.inputs)
      symbols_.inputs.emplace(input.name, graph_.add_table(table_of(input)));
    for (const auto& coordinate : document_.coordinates) {
      Symbols::Family family{coordinate.name, {}, coordinate.cyclic};
      if (coordinate.loops)
        family.loops = parser_.loops(*coordinate.loops, {.what = "the range of '" + coordinate.name + "'"});
      if (family.loops.size() > 2)
        fail(coordinate.place, "a coordinate is repeated over one or two loops, no more");
      symbols_.add(std::move(family));
    }
    declare_spaces();
    for (const std::string& name : program_.differentiated) add_as_coordinate(name);
  }

  void declare_spaces() {
    const SceneDocument::Spaces& spaces = document_.spaces;
    if (spaces.kinds.empty()) return;
    if (!program_.differentiated.empty())
      throw Misuse(
          fmt::format("scene '{}' is not in R^n: it is not differentiated by parameters", document_.name));
    for (std::size_t k = 0; k < spaces.components.size(); ++k)
      symbols_.components.emplace(spaces.components[k], static_cast<int>(k));
    symbols_.entries = spaces.entries;
    symbols_.rates = spaces.rates;
    for (const auto& [entry, text] : spaces.entries)
      symbols_.indexed.emplace(entry.substr(0, entry.find('[')),
                               static_cast<int>(1 + std::ranges::count(entry, ',')));
  }

  void add_as_coordinate(const std::string& name) {
    const auto stated = std::ranges::find(document_.parameters, name, &SceneDocument::Parameter::name);
    if (stated == document_.parameters.end() || stated->array || stated->size) {
      std::string known;
      for (const auto& parameter : document_.parameters)
        if (!parameter.array && !parameter.size) known += ' ' + parameter.name;
      throw Misuse(fmt::format("scene '{}' has no parameter '{}' to be differentiated by; there are{}",
                               document_.name, name, known.empty() ? " none" : known));
    }
    Symbols::Parameter& parameter = symbols_.parameters[static_cast<std::size_t>(symbols_.parameter(name))];
    if (parameter.family != none) throw Misuse(fmt::format("the parameter '{}' is named twice", name));
    parameter.family = static_cast<int>(symbols_.families.size());
    symbols_.add(Symbols::Family{name, {}, false});
  }

  /// With Σ v²/2 or Σ p²/2 of the parameters that are coordinates.
  Node with_parameters(Node energy) {
    for (const std::string& name : program_.differentiated) {
      const Node rate = graph_.coordinate(symbols_.family(name), none, Role::second);
      energy = graph_.add(energy, graph_.multiply(graph_.number(0.5), graph_.power(rate, 2)));
    }
    return energy;
  }

  bool has_velocity(std::span<const Node> roots) const {
    return std::ranges::any_of(graph_.reachable(roots), [&](Node node) { return is_velocity(graph_[node]); });
  }

  SceneFunction phase_function(Node whole, const std::string& what, Place place) {
    SceneFunction function{FunctionKind::phase};
    for (Term& term : terms_.of(whole, {}, what, place)) {
      Piece piece;
      piece.loops = std::move(term.loops);
      piece.outputs = {term.node};
      builder_.add_phase(function, std::move(piece));
    }
    return function;
  }

  void compile_energies() {
    const bool massless = !document_.rows.empty() || !document_.branches.empty() ||
                          !document_.states.empty();  // rows may say what moves
    if (document_.lagrangian || (massless && !document_.hamiltonian)) compile_lagrangian();
    if (document_.hamiltonian) {
      const Node whole = parser_.formula(*document_.hamiltonian, mechanics("the Hamiltonian", 'p'));
      if (!has_velocity(std::span(&whole, 1)))
        fail(document_.hamiltonian->start, "the Hamiltonian contains no momentum p_…: nothing would move");
      program_.hamiltonian =
          phase_function(with_parameters(whole), "the Hamiltonian", document_.hamiltonian->start);
    }
    if (!program_.lagrangian && !program_.hamiltonian)
      fail({},
           "the scene has neither a 'lagrangian' nor a 'hamiltonian'; these keys stand above the first "
           "[table]");
  }

  void compile_lagrangian() {
    const Place place = document_.lagrangian          ? document_.lagrangian->start
                        : !document_.branches.empty() ? document_.branches.front().place
                                                      : Place{};
    Node whole = document_.lagrangian
                     ? parser_.formula(*document_.lagrangian, mechanics("the Lagrangian", 'v'))
                     : graph_.number(0.0);
    whole = graph_.add(whole, circuit_.lagrangian());
    for (const auto& row : document_.rows)
      if (row.compliance) whole = graph_.subtract(whole, spring_energy(row));
    const std::vector<Node> nodes = graph_.reachable(std::span(&whole, 1));
    const bool driven = std::ranges::any_of(nodes, [&](Node node) { return graph_[node].op == Op::time; });
    const bool others = !document_.rows.empty() || !document_.states.empty() || !document_.force.empty() ||
                        document_.dissipation || !document_.branches.empty();
    if (!has_velocity(std::span(&whole, 1)) && !driven && !others)
      fail(place, "the Lagrangian contains no velocity v_…: nothing would move");
    program_.lagrangian = phase_function(with_parameters(whole), "the Lagrangian", place);
  }

  // Compliant rows φ(q) = 0 of compliance ε: φ(q) = s with the energy s²/(2ε) of the massless s, whose
  // equation makes the multiplier s/ε.  At ε = 0 the row is φ(q) = 0, and s rests at 0.

  Node compliance(const SceneDocument::Row& row) {
    Context context{.what = "the compliance of row '" + row.name + "'", .mechanics = true};
    context.loops = symbols_.families[static_cast<std::size_t>(symbols_.family(row.extension()))].loops;
    return parser_.formula(*row.compliance, context);
  }

  /// `value` where ε is not 0, else `at_zero`.
  Node unless_rigid(Node compliance, Node value, double at_zero) {
    constexpr double smallest = 1e-40;  // below, it is the row to the last bit
    const Node above = graph_.subtract(graph_.apply(Op::abs, compliance), graph_.number(smallest));
    return graph_.add(graph_.where(above, value),
                      graph_.where(graph_.negative(above), graph_.number(at_zero)));
  }

  Node extension(const SceneDocument::Row& row) {
    const int number = symbols_.family(row.extension());
    return graph_.coordinate(number, own_index(symbols_.families[static_cast<std::size_t>(number)]),
                             Role::position);
  }

  Node spring_energy(const SceneDocument::Row& row) {
    const Node flexible = compliance(row);
    const Node stiffness = unless_rigid(flexible, graph_.divide(graph_.number(1.0), flexible), 1.0);
    Node energy =
        graph_.multiply(graph_.multiply(graph_.number(0.5), stiffness), graph_.power(extension(row), 2));
    const auto& loops = symbols_.families[static_cast<std::size_t>(symbols_.family(row.extension()))].loops;
    for (std::size_t k = loops.size(); k-- > 0;) energy = graph_.sum(energy, loops[k]);
    return energy;
  }

  /// φ(q) − s, of the turn of its own loops: those of the coordinate.
  Node compliant(const SceneDocument::Row& row, Node position) {
    if (has_velocity(std::span(&position, 1)))
      fail(row.place,
           fmt::format("row '{}' holds velocities; 'compliance' is for rows on positions", row.name));
    const Node one = graph_.number(1.0);
    return graph_.subtract(position,
                           graph_.multiply(unless_rigid(compliance(row), one, 0.0), extension(row)));
  }

  // Rows.

  struct Row {
    RowGroup group;
    Node node;
  };

  void compile_rows() {
    std::vector<Row> rows;
    for (const auto& row : document_.rows) {
      const std::string what = "row '" + row.name + "'";
      std::vector<int> loops;
      if (row.compliance)
        loops = symbols_.families[static_cast<std::size_t>(symbols_.family(row.extension()))].loops;
      else if (row.loops)
        loops = parser_.loops(*row.loops, {.what = what});
      Node node = parser_.equation(row.equation, mechanics(what, 'v', loops));
      if (row.compliance) node = compliant(row, node);
      rows.push_back({{row.name, loops, row.equation.start}, node});
    }
    for (CircuitFormulas::Row& row : circuit_.rows())
      rows.push_back({{row.name, row.loops, row.place, row.origin}, row.node});
    for (const auto& state : document_.states) rows.push_back(state_row(state));
    std::vector<bool> order;  // which kinds there are, by first appearance
    for (const Row& row : rows) {
      const bool holonomic = is_holonomic(row);
      if (std::ranges::find(order, holonomic) == order.end()) order.push_back(holonomic);
    }
    for (const bool holonomic : order) {
      SceneFunction function{FunctionKind::rows, holonomic};
      Piece single;  // the rows that are not repeated
      for (const Row& row : rows)
        if (is_holonomic(row) == holonomic) add_row(function, single, row);
      if (!single.outputs.empty()) {
        const std::vector<Node> offsets = require_linear(function, single);
        builder_.add_rows(function, std::move(single), offsets);
      }
      program_.rows.push_back(std::move(function));
    }
  }

  /// v − rate = 0.  Its one-form is that of the state, along which nothing has mass: its force is what the
  /// Lagrangian and other rows make of the state, and acts on nothing else.
  Row state_row(const SceneDocument::State& state) {
    const std::string what = "the rate of '" + state.name + "'";
    const int family = symbols_.family(state.name);
    const Node rate = parser_.formula(state.rate, mechanics(what, 'v'));
    require_state_rate(state, family, rate, what);
    program_.states.push_back({family, value_function(state.rate, what)});
    const Node velocity = graph_.coordinate(family, none, Role::second);
    return {{"state_" + state.name, {}, state.rate.start}, graph_.subtract(velocity, rate)};
  }

  void require_state_rate(const SceneDocument::State& state, int family, Node rate, const std::string& what) {
    if (!program_.lagrangian)
      fail(state.place, "states need a 'lagrangian': beside a Hamiltonian alone they have no velocity");
    bool moved = false;
    for (const Node leaf : graph_.reachable(std::span(&rate, 1))) {
      if (!is_velocity(graph_[leaf])) continue;
      moved = true;
      const std::string& name = symbols_.families[static_cast<std::size_t>(graph_[leaf].a)].name;
      if (std::ranges::find(document_.states, name, &SceneDocument::State::name) != document_.states.end())
        fail(state.rate.start, fmt::format("{} holds v_{}, the rate of a state: states that feed on rates of "
                                           "states are not supported; write that rate out",
                                           what, name));
      const Node slope = graph_.derivative(rate, leaf);
      if (has_velocity(std::span(&slope, 1)))
        fail(state.rate.start,
             fmt::format("{} is not linear in v_{}; take a filtered velocity in its place, a state f with "
                         "rate = \"({} - f)/tau\", in which ({} - f)/tau is the velocity",
                         what, name, name, name));
    }
    if (moved && acts_back(family))
      fail(state.rate.start,
           fmt::format("{} holds velocities, and the Lagrangian or a row holds the state: its "
                       "force would act on these velocities; take a filtered velocity instead",
                       what));
  }

  /// Whether the Lagrangian or a row of the file holds the coordinate.
  bool acts_back(int family) {
    const auto holds = [&](std::span<const Node> roots) {
      return std::ranges::any_of(graph_.reachable(roots), [&](Node node) {
        return graph_[node].op == Op::coordinate && graph_[node].a == family;
      });
    };
    const auto row_holds = [&](const SceneDocument::Row& row) {
      const std::string what = "row '" + row.name + "'";
      std::vector<int> loops;
      if (row.loops) loops = parser_.loops(*row.loops, {.what = what});
      const Node node = parser_.equation(row.equation, mechanics(what, 'v', loops));
      return holds(std::span(&node, 1));
    };
    return std::ranges::any_of(program_.lagrangian->pieces,
                               [&](const Piece& piece) { return holds(piece.outputs); }) ||
           std::ranges::any_of(document_.rows, row_holds);
  }

  bool is_holonomic(const Row& row) const { return !has_velocity(std::span(&row.node, 1)); }

  void add_row(SceneFunction& function, Piece& single, const Row& row) {
    const int group = static_cast<int>(function.groups.size());
    function.groups.push_back(row.group);
    const std::string what = "row '" + row.group.name + "'";
    bool coordinates = false;
    for (Term& term : terms_.of(row.node, row.group.loops, what, row.group.place)) {
      for (const Node node : graph_.reachable(std::span(&term.node, 1)))
        coordinates = coordinates || graph_[node].op == Op::coordinate;
      if (term.loops.empty()) {
        single.outputs.push_back(term.node);
        single.groups.push_back(group);
        continue;
      }
      Piece piece;
      piece.loops = std::move(term.loops);
      piece.counting_loops = row.group.loops.size();
      piece.outputs = {term.node};
      piece.groups = {group};
      const std::vector<Node> offsets = require_linear(function, piece);
      builder_.add_rows(function, std::move(piece), offsets);
    }
    if (!coordinates) fail(row.group.place, what + " contains no coordinate and no velocity");
  }

  /// The outputs at v = 0, once it is sure that they are affine in v.
  std::vector<Node> require_linear(const SceneFunction& function, const Piece& piece) {
    std::vector<Node> offsets = piece.outputs;
    if (function.holonomic) return offsets;
    for (const Node leaf : graph_.reachable(piece.outputs)) {
      if (!is_velocity(graph_[leaf])) continue;
      for (std::size_t r = 0; r < piece.outputs.size(); ++r) {
        const Node slope = graph_.derivative(piece.outputs[r], leaf);
        if (!has_velocity(std::span(&slope, 1))) continue;
        const RowGroup& group = function.groups[static_cast<std::size_t>(piece.groups[r])];
        const std::string& name = symbols_.families[static_cast<std::size_t>(graph_[leaf].a)].name;
        fail(group.place,
             fmt::format("row '{}' is not linear in v_{}; expected A(q,t) v + b(q,t) = 0 or, without "
                         "velocities, f(q,t) = 0",
                         group.name, name));
      }
      offsets = graph_.substitute(offsets, leaf, graph_.number(0.0));
    }
    return offsets;
  }

  // Forces.

  void compile_force() {
    SceneFunction function{FunctionKind::force};
    Piece single;
    for (const auto& entry : document_.force) add_force(function, single, entry);
    for (const auto& [family, loops, force, place, what] : circuit_.forces()) {
      const Node target = graph_.coordinate(
          family, own_index(symbols_.families[static_cast<std::size_t>(family)]), Role::position);
      add_force_terms(function, single, terms_.of(force, loops, what, place), target);
    }
    add_dissipation(function, single);
    if (!single.outputs.empty()) builder_.add_force(function, std::move(single));
    if (!function.pieces.empty()) program_.force = std::move(function);
  }

  void add_force_terms(SceneFunction& function, Piece& single, const std::vector<Term>& terms, Node target) {
    for (const Term& term : terms) {
      Piece repeated;
      Piece& piece = term.loops.empty() ? single : repeated;
      piece.loops = term.loops;
      piece.outputs.push_back(term.node);
      piece.targets.push_back(target);
      if (!term.loops.empty()) builder_.add_force(function, std::move(repeated));
    }
  }

  void add_force(SceneFunction& function, Piece& single, const SceneDocument::Entry& entry) {
    const std::string& name = entry.key.text;
    const int number = symbols_.velocity(name);
    if (number == none)
      fail(entry.key.start,
           fmt::format("[force]: there is no coordinate '{}'{}", name, suggestion(name, coordinates())));
    const Symbols::Family family = symbols_.families[static_cast<std::size_t>(number)];
    if (entry.array) fail(entry.key.start, "[force]: expected one formula for each coordinate");
    const std::string what = "the force on '" + name + "'";
    const Node node = parser_.formula(entry.values[0], mechanics(what, 'v', family.loops));
    const Node target = graph_.coordinate(number, own_index(family), Role::position);
    add_force_terms(function, single, terms_.of(node, family.loops, what, entry.values[0].start), target);
  }

  /// The force −∂R/∂v of Rayleigh's function R.
  void add_dissipation(SceneFunction& function, Piece& single) {
    Node whole = circuit_.dissipation();
    Place place;
    if (document_.dissipation) {
      whole = graph_.add(parser_.formula(*document_.dissipation, mechanics("the dissipation", 'v')), whole);
      place = document_.dissipation->start;
    }
    if (document_.dissipation && !has_velocity(std::span(&whole, 1)))
      fail(place, "the dissipation contains no velocity v_…");
    for (const Term& term : terms_.of(whole, {}, "the dissipation", place)) {
      Piece repeated;
      Piece& piece = term.loops.empty() ? single : repeated;
      piece.loops = term.loops;
      for (const Node leaf : graph_.reachable(std::span(&term.node, 1))) {
        const NodeData data = graph_[leaf];
        if (!is_velocity(data)) continue;
        piece.outputs.push_back(graph_.negative(graph_.derivative(term.node, leaf)));
        piece.targets.push_back(graph_.coordinate(data.a, data.b, Role::position));
      }
      if (!term.loops.empty()) builder_.add_force(function, std::move(repeated));
    }
  }

  Node own_index(const Symbols::Family& family) {
    if (family.loops.empty()) return none;
    const Node first = graph_.loop_index(family.loops[0]);
    return family.loops.size() == 1 ? first : graph_.list(first, graph_.loop_index(family.loops[1]));
  }

  std::vector<std::string> coordinates() const {
    std::vector<std::string> names;
    for (const auto& family : symbols_.families)
      if (symbols_.velocity(family.name) != none) names.push_back(family.name);
    for (const auto& [name, number] : symbols_.components)
      if (symbols_.family(name) == none) names.push_back(name);
    return names;
  }

  // The start, references and invariants.

  NamedValue named_value(const SceneDocument::Entry& entry, Context context) {
    const std::string& key = entry.key.text;
    const bool momentum = key.starts_with("p_");
    const std::string bare = key.size() > 2 && (key.starts_with("v_") || momentum) ? key.substr(2) : key;
    NamedValue named{none, none, Role::position, momentum, {}, entry.key.start};
    for (const bool second : {false, true}) {
      const int family = second ? (bare == key ? none : symbols_.velocity(bare)) : symbols_.family(key);
      if (named.family != none || family == none) continue;
      named.family = family;
      named.role = second ? Role::second : Role::position;
      context.loops = symbols_.families[static_cast<std::size_t>(family)].loops;
    }
    if (named.family == none) {
      const NodeData leaf = graph_[parser_.coordinate(
          entry.key, {.what = context.what, .positions = true, .second = momentum ? 'p' : 'v'})];
      named.family = leaf.a;
      named.index = leaf.b;
      named.role = static_cast<Role>(leaf.c);
    }
    if (entry.array && context.loops.empty())
      fail(entry.key.start, fmt::format("'{}' takes one value, not an array", key));
    context.what = "the value of '" + key + "'";
    for (const FormulaText& value : entry.values) named.values.push_back(parser_.formula(value, context));
    return named;
  }

  void compile_start() {
    bool velocities = false;
    for (const auto& entry : document_.start) {
      program_.start.push_back(named_value(entry, {.what = "the start", .time = true}));
      const NamedValue& value = program_.start.back();
      if (value.role != Role::second) continue;
      if (velocities && program_.start_by_momentum != value.momentum)
        fail(value.place, "the start is given by velocities or by momenta, not by both");
      velocities = true;
      program_.start_by_momentum = value.momentum;
    }
    if (program_.start_by_momentum && !program_.hamiltonian)
      fail(program_.start.front().place,
           "a start with momenta needs a 'hamiltonian'; give velocities v_… instead");
    for (const FormulaText& guess : document_.guesses) compile_guess(guess);
    program_.start_time = document_.start_time
                              ? parser_.formula(*document_.start_time, {.what = "the start time"})
                              : graph_.number(0.0);
    differentiate_start();
  }

  void differentiate_start() {
    for (const std::string& name : program_.differentiated) {
      const Node parameter = graph_.parameter(symbols_.parameter(name));
      std::vector<NamedValue>& derivatives = program_.start_derivatives.emplace_back(program_.start);
      for (NamedValue& value : derivatives) value.values = graph_.derivative(value.values, parameter);
      if (!graph_.is_number(graph_.derivative(program_.start_time, parameter), 0.0))
        throw Misuse(
            fmt::format("the time of the start depends on '{}', by which it is not differentiated", name));
    }
  }

  void compile_guess(const FormulaText& guess) {
    const FormulaText zero{"0", guess.start};
    program_.guesses.push_back(named_value({guess, {zero}}, {.what = "'guess'"}));
    if (program_.guesses.back().momentum || program_.start_by_momentum)
      fail(guess.start, "'guess' is for starts by coordinates and velocities; this one is by momenta");
  }

  void compile_references() {
    for (const auto& reference : document_.references) {
      ReferenceProgram& program = program_.references.emplace_back();
      for (const auto& entry : reference.entries)
        program.values.push_back(
            named_value(entry, {.what = "the reference", .time = true, .reference = true}));
    }
  }

  void compile_invariants() {
    for (const auto& invariant : document_.invariants) {
      const std::string what = "invariant '" + invariant.name + "'";
      program_.invariants.push_back(
          {invariant.name, value_function(invariant.formula, what), invariant.value});
    }
  }

  /// A formula in t, q and v, or p where there is no Lagrangian, that is computed and not differentiated.
  SceneFunction value_function(const FormulaText& formula, const std::string& what) {
    return value_function(formula, what, mechanics(what, program_.lagrangian ? 'v' : 'p'));
  }

  /// The same of v, p and the forces of rows.
  SceneFunction motion_function(const FormulaText& formula, const std::string& what) {
    Context context = mechanics(what, program_.lagrangian ? 'v' : 'p');
    context.motion = true;
    return value_function(formula, what, context);
  }

  SceneFunction value_function(const FormulaText& formula, const std::string& what, const Context& context) {
    const Node node = parser_.formula(formula, context);
    SceneFunction function{FunctionKind::phase};
    for (Term& term : terms_.of(node, {}, what, formula.start)) {
      Piece piece;
      piece.loops = std::move(term.loops);
      piece.outputs = {term.node};
      builder_.add_value(function, std::move(piece));
    }
    return function;
  }

  void compile_control(const SceneDocument::Control& control) {
    const auto compiled = [&](const std::optional<FormulaText>& formula,
                              const std::string& what) -> std::optional<SceneFunction> {
      if (!formula) return std::nullopt;
      return phase_function(parser_.formula(*formula, mechanics(what, 'v')), what, formula->start);
    };
    program_.cost = compiled(control.cost, "the cost");
    program_.end_cost = compiled(control.end_cost, "the cost of the end");
  }

  void compile_event(const SceneDocument::Event& event) {
    const std::string what = "event '" + event.name + "'";
    EventProgram& program = program_.events.emplace_back();
    if (event.when) program.when = motion_function(*event.when, what);
    if (event.condition) program.condition = motion_function(*event.condition, "'if' of " + what);
    for (const auto& entry : event.set) {
      if (entry.array) fail(entry.key.start, "'set' takes one formula for each component, not an array");
      const FormulaText zero{"0", entry.key.start};
      program.set.push_back(named_value({entry.key, {zero}}, {.what = "'set' of " + what}));
      require_settable(program.set.back());
      program.values.push_back(motion_function(entry.values[0], "'set' of " + what));
    }
    if (event.restitution)
      program.restitution = motion_function(*event.restitution, "the restitution of " + what);
    if (event.when) compile_contact(event, program, what);
  }

  /// `when` as a row, where it is a function of coordinates and t.
  void compile_contact(const SceneDocument::Event& event, EventProgram& program, const std::string& what) {
    Context context = mechanics(what, program_.lagrangian ? 'v' : 'p');
    context.motion = true;
    Row row{{event.name, {}, event.when->start}, parser_.formula(*event.when, context)};
    bool gap = false;
    for (const Node node : graph_.reachable(std::span(&row.node, 1))) {
      const NodeData& data = graph_[node];
      const bool position = data.op == Op::coordinate && data.c == static_cast<int>(Role::position);
      gap = gap || position;
      if ((data.op != Op::coordinate || position) && data.op != Op::multiplier) continue;
      gap = false;
      break;
    }
    if (!gap && event.restitution)
      fail(event.when->start, what +
                                  " is an impact: its 'when' is the gap, a formula in coordinates and t "
                                  "without velocities");
    if (!gap) return;
    SceneFunction contact{FunctionKind::rows, true};
    Piece single;
    add_row(contact, single, row);
    if (!single.outputs.empty()) {
      const std::vector<Node> offsets = require_linear(contact, single);
      builder_.add_rows(contact, std::move(single), offsets);
    }
    program.contact = std::move(contact);
  }

  void compile_drawn(const SceneDocument::DrawnBody& body) {
    std::vector<Node>& values = program_.drawn.emplace_back();
    for (const auto* list : {&body.size, &body.fixed})
      for (const FormulaText& text : *list)
        values.push_back(parser_.formula(text, {.what = "the size or place of body '" + body.name + "'"}));
  }

  void require_settable(const NamedValue& value) const {
    const auto& family = symbols_.families[static_cast<std::size_t>(value.family)];
    if (!family.loops.empty() && value.index == none)
      fail(value.place, "'set' takes one component, such as " + family.name + "[1]");
    if (value.role == Role::second && value.momentum == program_.lagrangian.has_value())
      fail(value.place, program_.lagrangian ? "'set' takes velocities v_… where there is a Lagrangian"
                                            : "'set' takes momenta p_… beside a Hamiltonian alone");
    const std::size_t first = symbols_.families.size() - document_.states.size();
    if (value.role == Role::second && static_cast<std::size_t>(value.family) >= first)
      fail(value.place, fmt::format("v_{} is the rate of a state and is not set", family.name));
  }

  /// Those that kernels read.
  std::string source_of_tables() const {
    std::set<int> numbers;
    for (const SceneFunction* function : program_.functions())
      for (const Piece& piece : function->pieces)
        for (const Kernel& kernel : piece.kernels) kernel.add_tables(numbers);
    std::string text = numbers.empty() ? "" : LookupTable::source_of_value();
    for (const int number : numbers)
      text += graph_.tables()[static_cast<std::size_t>(number)].source(fmt::format("table{}", number));
    return text;
  }

  void write_source() {
    std::string body = kernel_prelude() + source_of_tables(), table;
    int number = 0;
    for (const SceneFunction* function : program_.functions())
      for (const Piece& piece : function->pieces)
        for (std::size_t k = 0; k < piece.kernels.size(); ++k) {
          const Kernel& kernel = piece.kernels[k];
          if (kernel.empty()) {
            table += "0, ";
            continue;
          }
          const std::string name = fmt::format("k{}", number++);
          body += kernel.source(name, piece.instance_width(), piece.position_width(function->kind, k));
          table += name + ", ";
        }
    program_.name = content_name(body + table);
    // "extern" first: a constant of C++ would otherwise stay inside its file.
    const std::string name = "diracstep_kernels_" + program_.name;
    program_.source = body + fmt::format(
                                 "DIRACSTEP_PUBLIC const diracstep_kernel {0}[];\n"
                                 "const diracstep_kernel {0}[] = {{{1}0}};\n",
                                 name, table);
  }

  SceneProgram& program_;
  SceneDocument& document_;
  FormulaGraph& graph_;
  Symbols& symbols_;
  FormulaParser parser_;
  SumTerms terms_;
  CircuitFormulas circuit_;
  PieceBuilder builder_;
};

}  // namespace

std::vector<const SceneFunction*> SceneProgram::functions() const {
  std::vector<const SceneFunction*> all;
  for (const auto* function : {&lagrangian, &hamiltonian, &force, &cost, &end_cost})
    if (*function) all.push_back(&**function);
  for (const SceneFunction& function : rows) all.push_back(&function);
  return all;
}

std::unique_ptr<SceneProgram> compile_scene(const std::string& file, const std::string& text, bool as_written,
                                            const std::vector<std::string>& differentiated) {
  SizeLimits limits = size_limits();
  limits.graph_nodes += text.size();  // a long file may take its time, a short one of a large system may not
  auto program = std::make_unique<SceneProgram>(read_document(file, text), as_written, limits);
  program->differentiated = differentiated;
  try {
    SceneCompiler(*program).compile();
  } catch (const FormulaGraph::TooLarge&) {
    throw SceneError(
        file, {},
        fmt::format(
            "the formulas and their derivatives have more than {} parts, the limit, or take more than {} "
            "visits of these; write repeated elements with for = \"i = 1..N\" and sum(i = 1..N, …)",
            limits.graph_nodes, limits.graph_visits));
  }
  program->graph.end_counting();
  return program;
}

}  // namespace diracstep::scene_compiler
