#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/detail/scene_compiler.hpp>

/// Rows of the file and of circuits, and those that states have.
namespace diracstep::scene_compiler {

/// φ(q) − s, of the turn of its own loops: those of the coordinate.
Node SceneCompiler::compliant(const SceneDocument::Row& row, Node position) {
  if (has_velocity(std::span(&position, 1)))
    fail(row.place,
         fmt::format("row '{}' holds velocities; 'compliance' is for rows on positions", row.name));
  const Node one = graph_.number(1.0);
  return graph_.subtract(position, graph_.multiply(unless_rigid(compliance(row), one, 0.0), extension(row)));
}

void SceneCompiler::compile_rows() {
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
SceneCompiler::Row SceneCompiler::state_row(const SceneDocument::State& state) {
  const std::string what = "the rate of '" + state.name + "'";
  const int family = symbols_.family(state.name);
  const Node rate = parser_.formula(state.rate, mechanics(what, 'v'));
  require_state_rate(state, family, rate, what);
  program_.states.push_back({family, value_function(state.rate, what)});
  const Node velocity = graph_.coordinate(family, none, Role::second);
  return {{"state_" + state.name, {}, state.rate.start}, graph_.subtract(velocity, rate)};
}

void SceneCompiler::require_state_rate(const SceneDocument::State& state, int family, Node rate,
                                       const std::string& what) {
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
bool SceneCompiler::acts_back(int family) {
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

bool SceneCompiler::is_holonomic(const Row& row) const { return !has_velocity(std::span(&row.node, 1)); }

void SceneCompiler::add_row(SceneFunction& function, Piece& single, const Row& row) {
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
std::vector<Node> SceneCompiler::require_linear(const SceneFunction& function, const Piece& piece) {
  std::vector<Node> offsets = piece.outputs;
  if (function.holonomic) return offsets;
  for (const Node leaf : graph_.reachable(piece.outputs)) {
    if (!is_velocity(graph_[leaf])) continue;
    for (std::size_t r = 0; r < piece.outputs.size(); ++r) {
      const Node slope = graph_.derivative(piece.outputs[r], leaf);
      if (!has_velocity(std::span(&slope, 1))) continue;
      const RowGroup& group = function.groups[static_cast<std::size_t>(piece.groups[r])];
      fail(group.place,
           fmt::format("row '{}' is not linear in {}; expected A(q,t) v + b(q,t) = 0 or, without "
                       "velocities, f(q,t) = 0",
                       group.name, symbols_.velocity_text(graph_[leaf].a)));
    }
    offsets = graph_.substitute(offsets, leaf, graph_.number(0.0));
  }
  return offsets;
}

}  // namespace diracstep::scene_compiler
