#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <diracstep/scene_format/compiler/detail/memory_pool.hpp>
#include <diracstep/scene_format/compiler/formula_graph.hpp>
#include <diracstep/scene_format/compiler/operations.hpp>
#include <utility>

namespace diracstep::scene_compiler {

int arity(Op op) {
  switch (op) {
    case Op::number:
    case Op::parameter:
    case Op::element:
    case Op::loop_index:
    case Op::time:
    case Op::scale:
    case Op::coordinate:
    case Op::multiplier:
      return 0;
    case Op::list:
    case Op::add:
    case Op::subtract:
    case Op::multiply:
    case Op::divide:
    case Op::pow:
    case Op::atan2:
    case Op::min:
    case Op::max:
    case Op::hypot:
    case Op::where:
    case Op::kepler_E:
    case Op::sn:
    case Op::cn:
    case Op::dn:
      return 2;
    default:
      return 1;
  }
}

std::size_t FormulaGraph::Hash::operator()(const NodeData& node) const {
  std::uint64_t hash = 1469598103934665603u;
  for (const std::uint64_t part :
       {static_cast<std::uint64_t>(node.op), static_cast<std::uint64_t>(node.a) * 3,
        static_cast<std::uint64_t>(node.b) * 5, static_cast<std::uint64_t>(node.c) * 7,
        std::bit_cast<std::uint64_t>(node.value)}) {
    hash = (hash ^ part) * 1099511628211u;
    hash ^= hash >> 29;
  }
  return static_cast<std::size_t>(hash);
}

Known FormulaGraph::known_of(const NodeData& node) const {
  switch (node.op) {
    case Op::number:
    case Op::parameter:
      return Known::once;
    case Op::loop_index:
      return Known::each_instance;
    case Op::element:
      return known(node.b);
    case Op::time:
    case Op::scale:
    case Op::coordinate:
    case Op::multiplier:
    case Op::sum:
      return Known::each_call;
    default:
      break;
  }
  const Known a = known(node.a);
  return arity(node.op) == 2 ? std::max(a, known(node.b)) : a;
}

Node FormulaGraph::insert(const NodeData& node) {
  const auto found = index_.find(node);
  if (found != index_.end()) return found->second;
  if (nodes_.size() >= limits_.graph_nodes)
    throw TooLarge("a formula graph of more than " + std::to_string(limits_.graph_nodes) + " nodes");
  const Node id = static_cast<Node>(nodes_.size());
  known_.push_back(known_of(node));
  nodes_.push_back(node);
  index_.emplace(node, id);
  return id;
}

bool FormulaGraph::is_number(Node node, double value) const {
  const NodeData& data = (*this)[node];
  return data.op == Op::number && data.value == value;
}

/// Computes now what depends on numbers alone, unless the result is not finite: that is told at the start.
Node FormulaGraph::fold(const NodeData& node) {
  const auto constant = [&](Node child) { return (*this)[child].op == Op::number; };
  const bool two = arity(node.op) == 2;
  if (constant(node.a) && (!two || constant(node.b))) {
    const double value = computed<double>(node, (*this)[node.a].value, two ? (*this)[node.b].value : 0.0);
    if (std::isfinite(value)) return number(value);
  }
  return insert(node);
}

Node FormulaGraph::apply(Op op, Node a, Node b) { return fold({op, a, b}); }

Node FormulaGraph::where(Node condition, Node value) {
  if (is_number(value, 0.0)) return value;
  const NodeData data = (*this)[condition];
  if (data.op != Op::number) return fold({Op::where, condition, value});
  if (data.value > 0.0) return value;
  return data.value < 0.0 ? number(0.0) : multiply(number(0.5), value);
}

Node FormulaGraph::table(int number, int order, Node u) {
  if (order > tables_[static_cast<std::size_t>(number)].degree) return this->number(0.0);
  return insert({Op::table, u, none, LookupTable::width * number + order});
}

Node FormulaGraph::negative(Node a) {
  if ((*this)[a].op == Op::negative) return (*this)[a].a;
  return fold({Op::negative, a});
}

Node FormulaGraph::add(Node a, Node b) {
  if (is_number(a, 0.0)) return b;
  if (is_number(b, 0.0)) return a;
  if (a == b) return multiply(number(2.0), a);
  if ((*this)[b].op == Op::negative) return subtract(a, (*this)[b].a);
  if ((*this)[a].op == Op::negative) return subtract(b, (*this)[a].a);
  return fold({Op::add, std::min(a, b), std::max(a, b)});  // one order, so that a+b and b+a are one node
}

Node FormulaGraph::subtract(Node a, Node b) {
  if (a == b) return number(0.0);
  if (is_number(a, 0.0)) return negative(b);
  if (is_number(b, 0.0)) return a;
  if ((*this)[b].op == Op::negative) return add(a, (*this)[b].a);
  return fold({Op::subtract, a, b});
}

/// Products of two numbers are judged here; those that hold parameters when these have their values.
bool FormulaGraph::may_gather(Node a, Node b) const {
  const NodeData &first = (*this)[a], &second = (*this)[b];
  if (as_written_) return false;
  return first.op != Op::number || second.op != Op::number || std::isnormal(first.value * second.value);
}

Node FormulaGraph::multiply(Node a, Node b) {
  if (is_number(a, 0.0) || is_number(b, 0.0)) return number(0.0);
  if (is_number(a, 1.0)) return b;
  if (is_number(b, 1.0)) return a;
  if (is_number(a, -1.0)) return negative(b);
  if (is_number(b, -1.0)) return negative(a);
  if (a == b) return power(a, 2);
  if ((*this)[a].op == Op::negative) return negative(multiply((*this)[a].a, b));
  if ((*this)[b].op == Op::negative) return negative(multiply(a, (*this)[b].a));
  // What is known earlier is gathered, so that it is computed earlier: c·(d·x) becomes (c·d)·x.
  if (known(a) > known(b)) std::swap(a, b);
  if (known(a) < Known::each_call && (*this)[b].op == Op::multiply &&
      known((*this)[b].a) < Known::each_call && may_gather(a, (*this)[b].a))
    return multiply(multiply(a, (*this)[b].a), (*this)[b].b);
  if (known(a) == known(b) && a > b) std::swap(a, b);
  return fold({Op::multiply, a, b});
}

Node FormulaGraph::divide(Node a, Node b) {
  if (is_number(b, 1.0)) return a;
  if (is_number(a, 0.0) && !is_number(b, 0.0)) return number(0.0);
  if (!as_written_ && known(a) == Known::each_call && known(b) < Known::each_call &&
      ((*this)[b].op != Op::number || std::isnormal(1.0 / (*this)[b].value)))
    return multiply(fold({Op::divide, number(1.0), b}), a);  // one division beforehand, not one a call
  return fold({Op::divide, a, b});
}

Node FormulaGraph::power(Node a, int exponent) {
  constexpr int largest = 64;
  if (exponent == 0) return number(1.0);
  if (exponent == 1) return a;
  if (exponent < 0) return divide(number(1.0), power(a, -exponent));
  if (exponent > largest) return fold({Op::pow, a, number(exponent)});
  return fold({Op::power, a, none, exponent});
}

Node FormulaGraph::raise(Node a, Node exponent) {
  const NodeData e = (*this)[exponent];
  if (e.op == Op::number && e.value == std::floor(e.value) && std::abs(e.value) <= 64.0)
    return power(a, static_cast<int>(e.value));
  if (is_number(exponent, 0.5)) return apply(Op::sqrt, a);
  return fold({Op::pow, a, exponent});
}

namespace {

struct Searches {
  std::vector<std::uint64_t> visits;  ///< the last search that reached each node, of any graph
  std::uint64_t count = 0;
};

}  // namespace

/// Visits only what is reached: files of many small formulas are read in a time that grows with their length.
std::vector<Node> FormulaGraph::reachable(std::span<const Node> roots, bool with_indices) const {
  // Scenes of one compiled file are loaded by several threads at once, which may outlive what is destroyed at
  // exit.
  static MemoryPool<Searches>& pool = *new MemoryPool<Searches>;
  MemoryPool<Searches>::Loan loan(pool);
  Searches& kept = *loan;
  if (kept.visits.size() < nodes_.size()) kept.visits.resize(nodes_.size(), 0);
  std::vector<Node> nodes;
  const auto reach = [&nodes, last = kept.visits.data(), search = ++kept.count](Node node) {
    if (std::exchange(last[node], search) != search) nodes.push_back(node);
  };
  for (const Node root : roots) reach(root);
  std::size_t next = 0;
  while (next < nodes.size()) {  // which grows
    const NodeData& data = (*this)[nodes[next++]];
    if (arity(data.op) >= 1) reach(data.a);
    const bool index =
        with_indices && (data.op == Op::element || data.op == Op::coordinate) && data.b != none;
    if (arity(data.op) == 2 || index) reach(data.b);
  }
  if (counting_ && (visited_ += nodes.size()) > limits_.graph_visits)
    throw TooLarge("more than " + std::to_string(limits_.graph_visits) +
                   " visits of nodes of a formula graph");
  std::ranges::sort(nodes);
  return nodes;
}

Node FormulaGraph::partial(Node node, bool second) {
  const NodeData f = (*this)[node];
  const Node a = f.a, b = f.b, one = number(1.0);
  const auto inverse = [&](Node x) { return divide(one, x); };
  const auto one_plus = [&](Node x) { return add(one, x); };
  const auto one_minus = [&](Node x) { return subtract(one, x); };
  switch (f.op) {
    case Op::negative:
      return number(-1.0);
    case Op::add:
      return one;
    case Op::subtract:
      return number(second ? -1.0 : 1.0);
    case Op::multiply:
      return second ? a : b;
    case Op::divide:
      return second ? negative(multiply(node, inverse(b))) : inverse(b);
    case Op::power:
      return multiply(number(f.c), power(a, f.c - 1));
    case Op::pow:
      return second ? multiply(node, apply(Op::log, a)) : multiply(b, raise(a, subtract(b, one)));
    case Op::sqrt:
      return multiply(number(0.5), inverse(node));
    case Op::sin:
      return apply(Op::cos, a);
    case Op::cos:
      return negative(apply(Op::sin, a));
    case Op::tan:
      return one_plus(power(node, 2));
    case Op::asin:
      return inverse(apply(Op::sqrt, multiply(one_minus(a), one_plus(a))));
    case Op::acos:
      return negative(inverse(apply(Op::sqrt, multiply(one_minus(a), one_plus(a)))));
    case Op::atan:
      return inverse(one_plus(power(a, 2)));
    case Op::atan2: {
      const Node size = apply(Op::hypot, a, b);
      return second ? negative(divide(divide(a, size), size)) : divide(divide(b, size), size);
    }
    case Op::sinh:
      return apply(Op::cosh, a);
    case Op::cosh:
      return apply(Op::sinh, a);
    case Op::tanh:
      // Where it is below 1e-303 zero: the product of an overflow and an underflow is in its derivative.
      return where(subtract(number(350.0), apply(Op::abs, a)), power(inverse(apply(Op::cosh, a)), 2));
    case Op::asinh:
      return inverse(apply(Op::hypot, one, a));
    case Op::acosh:
      return inverse(multiply(apply(Op::sqrt, subtract(a, one)), apply(Op::sqrt, one_plus(a))));
    case Op::atanh:
      return inverse(multiply(one_minus(a), one_plus(a)));
    case Op::exp:
      return node;
    case Op::log:
      return inverse(a);
    case Op::abs:
      return apply(Op::sign, a);
    case Op::sign:
    case Op::floor:
      return number(0.0);
    case Op::table:
      return table(f.c / LookupTable::width, f.c % LookupTable::width + 1, a);
    case Op::hypot:
      return divide(second ? b : a, node);
    default:
      throw Error("a function without a derivative was differentiated");
  }
}

/// The derivative of min, max or where, of whose arguments only the chosen one counts: no product with zero,
/// which would be NaN beside an infinite slope.
Node FormulaGraph::change_of_choice(const NodeData& choice, Node of_a, Node of_b) {
  if (choice.op == Op::where) return where(choice.a, of_b);
  const bool largest = choice.op == Op::max;
  const Node first = subtract(choice.a, choice.b), second = subtract(choice.b, choice.a);
  return add(where(largest ? first : second, of_a), where(largest ? second : first, of_b));
}

std::vector<Node> FormulaGraph::derivative(std::span<const Node> roots, Node symbol) {
  const Node zero = number(0.0);
  const std::vector<Node> nodes = reachable(roots);
  std::unordered_map<Node, Node> changes;  // only those other than zero
  const auto change = [&](Node node) {
    const auto found = changes.find(node);
    return found == changes.end() ? zero : found->second;
  };
  for (const Node node : nodes) {
    if (node == symbol) {
      changes[node] = number(1.0);
      continue;
    }
    const NodeData data = (*this)[node];
    if (data.op == Op::min || data.op == Op::max || data.op == Op::where) {
      const Node chosen = change_of_choice(data, change(data.a), change(data.b));
      if (chosen != zero) changes[node] = chosen;
      continue;
    }
    Node sum = zero;
    for (const bool second : {false, true}) {
      if (arity(data.op) < (second ? 2 : 1) || data.op == Op::list) continue;
      const Node inner = change(second ? data.b : data.a);
      if (inner != zero) sum = add(sum, multiply(inner, partial(node, second)));
    }
    if (sum != zero) changes[node] = sum;
  }
  std::vector<Node> derivatives;
  for (const Node root : roots) derivatives.push_back(change(root));
  return derivatives;
}

Node FormulaGraph::rebuild(const NodeData& node) {
  switch (node.op) {
    case Op::negative:
      return negative(node.a);
    case Op::add:
      return add(node.a, node.b);
    case Op::subtract:
      return subtract(node.a, node.b);
    case Op::multiply:
      return multiply(node.a, node.b);
    case Op::divide:
      return divide(node.a, node.b);
    case Op::power:
      return power(node.a, node.c);
    case Op::pow:
      return raise(node.a, node.b);
    case Op::where:
      return where(node.a, node.b);
    case Op::table:
      return insert(node);
    default:
      return fold(node);
  }
}

std::vector<Node> FormulaGraph::substitute(std::span<const Node> roots, Node leaf, Node replacement) {
  std::unordered_map<Node, Node> changed{{leaf, replacement}};
  const auto now = [&](Node node) {
    const auto found = changed.find(node);
    return found == changed.end() ? node : found->second;
  };
  for (const Node node : reachable(roots)) {
    NodeData data = (*this)[node];
    const int arguments = arity(data.op);
    if (arguments == 0) continue;
    const Node a = now(data.a), b = arguments == 2 ? now(data.b) : data.b;
    if (a == data.a && b == data.b) continue;
    data.a = a;
    data.b = b;
    changed[node] = rebuild(data);
  }
  std::vector<Node> results;
  for (const Node root : roots) results.push_back(now(root));
  return results;
}

}  // namespace diracstep::scene_compiler
