#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/detail/scene_compiler.hpp>

/// What is computed along a motion or at its start and not differentiated, and events.
namespace diracstep::scene_compiler {

NamedValue SceneCompiler::named_value(const SceneDocument::Entry& entry, Context context) {
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

void SceneCompiler::compile_start() {
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

void SceneCompiler::differentiate_start() {
  for (const std::string& name : program_.differentiated) {
    const Node parameter = graph_.parameter(symbols_.parameter(name));
    std::vector<NamedValue>& derivatives = program_.start_derivatives.emplace_back(program_.start);
    for (NamedValue& value : derivatives) value.values = graph_.derivative(value.values, parameter);
    if (!graph_.is_number(graph_.derivative(program_.start_time, parameter), 0.0))
      throw Misuse(
          fmt::format("the time of the start depends on '{}', by which it is not differentiated", name));
  }
}

void SceneCompiler::compile_guess(const FormulaText& guess) {
  const FormulaText zero{"0", guess.start};
  program_.guesses.push_back(named_value({guess, {zero}}, {.what = "'guess'"}));
  if (program_.guesses.back().momentum || program_.start_by_momentum)
    fail(guess.start, "'guess' is for starts by coordinates and velocities; this one is by momenta");
}

void SceneCompiler::compile_references() {
  for (const auto& reference : document_.references) {
    ReferenceProgram& program = program_.references.emplace_back();
    for (const auto& entry : reference.entries)
      program.values.push_back(
          named_value(entry, {.what = "the reference", .time = true, .reference = true}));
  }
}

void SceneCompiler::compile_invariants() {
  for (const auto& invariant : document_.invariants) {
    const std::string what = "invariant '" + invariant.name + "'";
    program_.invariants.push_back({invariant.name, value_function(invariant.formula, what), invariant.value});
  }
}

/// A formula in t, q and v, or p where there is no Lagrangian, that is computed and not differentiated.
SceneFunction SceneCompiler::value_function(const FormulaText& formula, const std::string& what) {
  return value_function(formula, what, mechanics(what, program_.lagrangian ? 'v' : 'p'));
}

/// The same of v, p and the forces of rows.
SceneFunction SceneCompiler::motion_function(const FormulaText& formula, const std::string& what) {
  Context context = mechanics(what, program_.lagrangian ? 'v' : 'p');
  context.motion = true;
  return value_function(formula, what, context);
}

SceneFunction SceneCompiler::value_function(const FormulaText& formula, const std::string& what,
                                            const Context& context) {
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

void SceneCompiler::compile_control(const SceneDocument::Control& control) {
  const auto compiled = [&](const std::optional<FormulaText>& formula,
                            const std::string& what) -> std::optional<SceneFunction> {
    if (!formula) return std::nullopt;
    return phase_function(parser_.formula(*formula, mechanics(what, 'v')), what, formula->start);
  };
  program_.cost = compiled(control.cost, "the cost");
  program_.end_cost = compiled(control.end_cost, "the cost of the end");
}

void SceneCompiler::compile_event(const SceneDocument::Event& event) {
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
void SceneCompiler::compile_contact(const SceneDocument::Event& event, EventProgram& program,
                                    const std::string& what) {
  Context context = mechanics(what, program_.lagrangian ? 'v' : 'p');
  context.motion = true;
  Row row{{event.name, {}, event.when->start}, parser_.formula(*event.when, context)};
  if (graph_.known(row.node) != Known::each_call)
    fail(event.when->start,
         what + " never happens: its 'when' holds neither the time nor anything of the motion");
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

void SceneCompiler::compile_drawn(const SceneDocument::DrawnBody& body) {
  std::vector<Node>& values = program_.drawn.emplace_back();
  for (const auto* list : {&body.size, &body.fixed})
    for (const FormulaText& text : *list)
      values.push_back(parser_.formula(text, {.what = "the size or place of body '" + body.name + "'"}));
}

void SceneCompiler::require_settable(const NamedValue& value) const {
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

}  // namespace diracstep::scene_compiler
