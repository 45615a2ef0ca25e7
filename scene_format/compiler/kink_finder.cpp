#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/kink_finder.hpp>
#include <numbers>

namespace diracstep::scene_compiler {

namespace {

constexpr int narrowing_power =
    4;  // from here on u^c is looked at where |u| is largest: a pulse of width |u/(c u'')|^½

}  // namespace

KinkProgram KinkFinder::find() {
  const auto look = [&](const SceneFunction& function, bool momenta) {
    for (const Piece& piece : function.pieces) look_through({&piece, momenta});
  };
  if (program_.lagrangian)
    look(*program_.lagrangian, false);
  else
    look(*program_.hamiltonian, true);
  if (program_.force) look(*program_.force, false);
  for (const SceneFunction& rows : program_.rows) look(rows, false);
  if (program_.cost) look(*program_.cost, false);
  return std::move(found_);
}

void KinkFinder::look_through(const Source& source) {
  for (const Node node : graph_.reachable(source.piece->outputs))
    if (graph_.known(node) == Known::each_call) look_at(node, source);
}

void KinkFinder::look_at(Node node, const Source& source) {
  if (!seen_.insert(node).second) return;
  const NodeData data = graph_[node];
  switch (data.op) {
    case Op::abs:
      return add_switch(found_.kinks, data.a, node, "abs", source);
    case Op::sign:
    case Op::where:
      return add_switch(found_.kinks, data.a, node, "a jump", source);
    case Op::floor:  // at whole numbers
      return add_switch(found_.kinks,
                        graph_.apply(Op::sin, graph_.multiply(graph_.number(std::numbers::pi), data.a)), node,
                        "a jump", source);
    case Op::table:
      for (const double knot : graph_.tables()[static_cast<std::size_t>(data.c / LookupTable::width)].knots)
        if (graph_[data.a].op == Op::time)
          found_.knots.insert(knot);
        else
          add_switch(found_.kinks, graph_.subtract(data.a, graph_.number(knot)), node, "a table", source);
      return;
    case Op::min:
    case Op::max:
      return add_switch(found_.kinks, graph_.subtract(data.a, data.b), node,
                        data.op == Op::min ? "min" : "max", source);
    case Op::sqrt:  // of a square: |u|
      if (const NodeData square = graph_[data.a];
          (square.op == Op::power && square.c == 2) || (square.op == Op::multiply && square.a == square.b))
        return add_switch(found_.kinks, square.a, node, "sqrt", source);
      break;
    case Op::tanh:
    case Op::atan:
      add_switch(found_.ramps, data.a, node, data.op == Op::tanh ? "tanh" : "atan", source);
      break;
    case Op::sin:
    case Op::cos:
    case Op::tan:
      return add_phase(data.a, source);
    default:
      break;
  }
  // Pulses and ramps of the time: around the zero of an affine argument, else where the argument is extreme.
  const bool quotient = data.op == Op::divide;
  const bool looked_at = quotient || data.op == Op::exp || data.op == Op::tanh || data.op == Op::atan ||
                         data.op == Op::cosh || data.op == Op::sinh || data.op == Op::power ||
                         data.op == Op::pow || data.op == Op::sqrt || data.op == Op::log ||
                         data.op == Op::asinh;
  if (!looked_at) return;
  const Node u = quotient ? data.b : data.a, rate = rate_in_time(u);
  if (rate == none) return;
  const Node one = graph_.number(1.0);
  if (graph_.known(rate) < Known::each_call || data.op == Op::tanh || data.op == Op::atan)
    return add_instant(u, graph_.apply(Op::abs, graph_.divide(one, rate)), source);
  const Node bend = graph_.derivative(rate, graph_.time());
  Node square = graph_.divide(graph_.number(2.0), bend);  // of the width, where u is extreme
  if (data.op != Op::exp) square = graph_.multiply(square, u);
  if (data.op == Op::power) {
    if (data.c < narrowing_power) return;
    square = graph_.divide(square, graph_.number(data.c));
  }
  add_instant(rate, graph_.apply(Op::sqrt, graph_.apply(Op::abs, square)), source);
}

void KinkFinder::add_switch(SceneFunction& kind, Node g, Node place, const char* what, const Source& source) {
  if (source.momenta && holds(g, Op::coordinate, Role::second)) return;  // no velocity tells its sign
  const auto found = program_.symbols.places.find(place);
  const std::string name = found == program_.symbols.places.end() || found->second.line == 0
                               ? what
                               : fmt::format("{} in line {}", what, found->second.line);
  add_output(kind, g, name, source.piece->loops);
  if (&kind == &found_.kinks && rate_in_time(g) != none) add_instant(g, graph_.number(0.0), source);
}

void KinkFinder::add_instant(Node event, Node width, const Source& source) {
  const std::vector<Node> both{event, width};
  std::vector<int> loops = source.piece->loops;
  std::erase_if(loops, [&](int loop) {
    return std::ranges::none_of(
        both, [&](Node root) { return std::ranges::count(loops_of(root, source.piece->loops), loop) > 0; });
  });
  add_output(found_.events, event, "event", loops);
  add_output(found_.widths, width, "width", loops);
}

void KinkFinder::add_phase(Node argument, const Source& source) {
  const Node rate = rate_in_time(argument);
  if (rate != none) add_output(found_.phase_rates, rate, "phase", source.piece->loops);
}

Node KinkFinder::rate_in_time(Node u) {
  for (auto k = dependence_.size(); k < graph_.size(); ++k) {  // arguments come before what holds them
    const NodeData& data = graph_[static_cast<Node>(k)];
    Dependence own{data.op == Op::time, data.op == Op::coordinate};
    for (const auto& [argument, from] : {std::pair{data.a, 1}, std::pair{data.b, 2}}) {
      if (arity(data.op) < from) continue;
      const Dependence& other = dependence_[static_cast<std::size_t>(argument)];
      own = {own.time || other.time, own.coordinates || other.coordinates};
    }
    dependence_.push_back(own);
  }
  const Dependence& depends = dependence_[static_cast<std::size_t>(u)];
  if (!depends.time || depends.coordinates) return none;
  const Node rate = graph_.derivative(u, graph_.time());
  return graph_.is_number(rate, 0.0) ? none : rate;
}

bool KinkFinder::holds(Node root, Op op, Role role) const {
  return std::ranges::any_of(graph_.reachable(std::span(&root, 1)), [&](Node node) {
    return graph_[node].op == op && graph_[node].c == static_cast<int>(role);
  });
}

/// Those of the loops whose variable `root` holds, and those that their bounds hold.
std::vector<int> KinkFinder::loops_of(Node root, const std::vector<int>& loops) const {
  std::vector<Node> roots{root};
  std::vector<int> kept;
  for (auto at = loops.rbegin(); at != loops.rend(); ++at) {  // Clang 14 does not compile std::views::reverse
    const int loop = *at;
    const bool held = std::ranges::any_of(graph_.reachable(roots, true), [&](Node node) {
      return graph_[node].op == Op::loop_index && graph_[node].a == loop;
    });
    if (!held) continue;
    kept.insert(kept.begin(), loop);
    const Loop& range = program_.symbols.loops[static_cast<std::size_t>(loop)];
    roots.insert(roots.end(), {range.first, range.last});
  }
  return kept;
}

void KinkFinder::add_output(SceneFunction& function, Node output, const std::string& name,
                            const std::vector<int>& all) {
  const bool counted = &function == &found_.events || &function == &found_.widths;  // these count alike
  Piece piece;
  piece.loops = counted ? all : loops_of(output, all);
  piece.counting_loops = piece.loops.size();
  piece.outputs = {output};
  piece.groups = {static_cast<int>(function.groups.size())};
  function.groups.push_back({name, piece.loops, {}});
  builder_.add_outputs(function, std::move(piece));
}

}  // namespace diracstep::scene_compiler
