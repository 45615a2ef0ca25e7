#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/detail/scene_compiler.hpp>

/// L, H and the forces.
namespace diracstep::scene_compiler {

/// With Σ v²/2 or Σ p²/2 of the parameters that are coordinates.
Node SceneCompiler::with_parameters(Node energy) {
  for (const std::string& name : program_.differentiated) {
    const Node rate = graph_.coordinate(symbols_.family(name), none, Role::second);
    energy = graph_.add(energy, graph_.multiply(graph_.number(0.5), graph_.power(rate, 2)));
  }
  return energy;
}

bool SceneCompiler::has_velocity(std::span<const Node> roots) const {
  return std::ranges::any_of(graph_.reachable(roots), [&](Node node) { return is_velocity(graph_[node]); });
}

SceneFunction SceneCompiler::phase_function(Node whole, const std::string& what, Place place) {
  SceneFunction function{FunctionKind::phase};
  for (Term& term : terms_.of(whole, {}, what, place)) {
    Piece piece;
    piece.loops = std::move(term.loops);
    piece.outputs = {term.node};
    builder_.add_phase(function, std::move(piece));
  }
  return function;
}

void SceneCompiler::compile_energies() {
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

void SceneCompiler::compile_lagrangian() {
  const Place place = document_.lagrangian          ? document_.lagrangian->start
                      : !document_.branches.empty() ? document_.branches.front().place
                                                    : Place{};
  Node whole = document_.lagrangian ? parser_.formula(*document_.lagrangian, mechanics("the Lagrangian", 'v'))
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

Node SceneCompiler::compliance(const SceneDocument::Row& row) {
  Context context{.what = "the compliance of row '" + row.name + "'", .mechanics = true};
  context.loops = symbols_.families[static_cast<std::size_t>(symbols_.family(row.extension()))].loops;
  return parser_.formula(*row.compliance, context);
}

/// `value` where ε is not 0, else `at_zero`.
Node SceneCompiler::unless_rigid(Node compliance, Node value, double at_zero) {
  constexpr double smallest = 1e-40;  // below, it is the row to the last bit
  const Node above = graph_.subtract(graph_.apply(Op::abs, compliance), graph_.number(smallest));
  return graph_.add(graph_.where(above, value), graph_.where(graph_.negative(above), graph_.number(at_zero)));
}

Node SceneCompiler::extension(const SceneDocument::Row& row) {
  const int number = symbols_.family(row.extension());
  return graph_.coordinate(number, own_index(symbols_.families[static_cast<std::size_t>(number)]),
                           Role::position);
}

Node SceneCompiler::spring_energy(const SceneDocument::Row& row) {
  const Node flexible = compliance(row);
  const Node stiffness = unless_rigid(flexible, graph_.divide(graph_.number(1.0), flexible), 1.0);
  Node energy =
      graph_.multiply(graph_.multiply(graph_.number(0.5), stiffness), graph_.power(extension(row), 2));
  const auto& loops = symbols_.families[static_cast<std::size_t>(symbols_.family(row.extension()))].loops;
  for (std::size_t k = loops.size(); k-- > 0;) energy = graph_.sum(energy, loops[k]);
  return energy;
}

void SceneCompiler::compile_force() {
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

void SceneCompiler::add_force_terms(SceneFunction& function, Piece& single, const std::vector<Term>& terms,
                                    Node target) {
  for (const Term& term : terms) {
    Piece repeated;
    Piece& piece = term.loops.empty() ? single : repeated;
    piece.loops = term.loops;
    piece.outputs.push_back(term.node);
    piece.targets.push_back(target);
    if (!term.loops.empty()) builder_.add_force(function, std::move(repeated));
  }
}

void SceneCompiler::add_force(SceneFunction& function, Piece& single, const SceneDocument::Entry& entry) {
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
void SceneCompiler::add_dissipation(SceneFunction& function, Piece& single) {
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

}  // namespace diracstep::scene_compiler
