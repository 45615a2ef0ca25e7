#pragma once

#include <cstddef>
#include <deque>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/compiler/lookup_table.hpp>
#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace diracstep::scene_compiler {

/// What a node of a formula is.  The first group are leaves, the second stands for repetition, the rest
/// compute.
enum class Op : unsigned char {
  number,      ///< a constant
  parameter,   ///< a = number of the parameter or size
  element,     ///< a = number of an array parameter, b = index
  loop_index,  ///< a = number of the loop
  time,
  scale,       ///< s in ∂(A w + s b)/∂q
  coordinate,  ///< a = family of coordinates, b = index or none, c = Role
  multiplier,  ///< a = output of a piece; where c = 1 number of a force
  list,        ///< (a, b): two indices
  sum,         ///< of a over the loop numbered b
  negative,
  add,
  subtract,
  multiply,
  divide,
  power,  ///< a to the whole number c, at least 2
  pow,
  sqrt,
  sin,
  cos,
  tan,
  asin,
  acos,
  atan,
  atan2,
  sinh,
  cosh,
  tanh,
  asinh,
  acosh,
  atanh,
  exp,
  log,
  abs,
  sign,
  min,
  max,
  hypot,
  floor,
  table,     ///< c = number of a LookupTable times 4, plus the order of its derivative
  where,     ///< b where a > 0, b/2 where a = 0, else 0: derivatives of min and max
  kepler_E,  ///< from here on for references only, without derivatives
  sn,
  cn,
  dn
};

/// Which column of numbers a coordinate's value is read from.
enum class Role : int {
  position,
  second,    ///< the velocity or the momentum
  direction  ///< w, the vector that rows are contracted with
};

/// When the value of a node is known.
enum class Known : unsigned char {
  once,           ///< as soon as the parameters are
  each_instance,  ///< for each instance of a repeated element
  each_call       ///< it depends on coordinates or the time
};

using Node = int;
inline constexpr Node none = -1;

struct NodeData {
  Op op;
  int a = none;
  int b = none;
  int c = 0;
  double value = 0.0;
  bool operator==(const NodeData&) const = default;
};

/// Formulas as one graph in which equal subexpressions are one node.  Children come before their parents, so
/// ascending order is an order of evaluation, and nothing here recurses.  The same calls in the same order
/// give the same graph: no result depends on addresses or hashes.
class FormulaGraph {
 public:
  /// More nodes, or more visits of nodes, than the limits allow.
  class TooLarge : public Error {
    using Error::Error;
  };

  /// `as_written`: products and quotients are computed as they stand.  Else what is known early is gathered,
  /// c·(d·x) = (c·d)·x and x/c = (1/c)·x, which saves time in every call but leaves the range of numbers
  /// where c·d or 1/c does.
  explicit FormulaGraph(bool as_written = false, const SizeLimits& limits = {})
      : as_written_(as_written), limits_(limits) {}

  Node number(double value) { return insert({Op::number, none, none, 0, value}); }
  Node parameter(int id) { return insert({Op::parameter, id}); }
  Node element(int id, Node index) { return insert({Op::element, id, index}); }
  Node loop_index(int loop) { return insert({Op::loop_index, loop}); }
  Node time() { return insert({Op::time}); }
  Node scale() { return insert({Op::scale}); }
  Node coordinate(int family, Node index, Role role) {
    return insert({Op::coordinate, family, index, static_cast<int>(role)});
  }
  Node multiplier(int output) { return insert({Op::multiplier, output}); }
  /// The force of a row, by its number in Symbols::forces.
  Node force(int number) { return insert({Op::multiplier, number, none, 1}); }
  Node list(Node first, Node second) { return insert({Op::list, first, second}); }
  Node sum(Node body, int loop) { return insert({Op::sum, body, loop}); }

  Node negative(Node a);
  Node add(Node a, Node b);
  Node subtract(Node a, Node b);
  Node multiply(Node a, Node b);
  Node divide(Node a, Node b);
  Node raise(Node a, Node exponent);
  Node power(Node a, int exponent);
  /// `value` where condition > 0, half of it where condition = 0, else 0, and then nothing of `value` is
  /// left.
  Node where(Node condition, Node value);
  int add_table(LookupTable table) {
    tables_.push_back(std::move(table));
    return static_cast<int>(tables_.size()) - 1;
  }
  const std::deque<LookupTable>& tables() const { return tables_; }
  /// A table, or its derivative of an order, at u.
  Node table(int number, int order, Node u);
  /// Any other operation of one or two arguments.
  Node apply(Op op, Node a, Node b = none);

  bool as_written() const { return as_written_; }
  const NodeData& operator[](Node node) const { return nodes_[static_cast<std::size_t>(node)]; }
  std::size_t size() const { return nodes_.size(); }
  Known known(Node node) const { return known_[static_cast<std::size_t>(node)]; }
  bool is_number(Node node, double value) const;

  /// All nodes that the roots depend on, themselves included, ascending.  Leaves' indices are left out unless
  /// asked for.
  std::vector<Node> reachable(std::span<const Node> roots, bool with_indices = false) const;

  /// It is complete: what is read of it from now on, by several threads at once, counts for no limit.
  void end_counting() { counting_ = false; }

  /// ∂root/∂symbol for each root; the symbol is a leaf.
  std::vector<Node> derivative(std::span<const Node> roots, Node symbol);
  Node derivative(Node root, Node symbol) { return derivative(std::span<const Node>(&root, 1), symbol)[0]; }

  /// Each root with `replacement` in place of `leaf`.
  std::vector<Node> substitute(std::span<const Node> roots, Node leaf, Node replacement);

 private:
  struct Hash {
    std::size_t operator()(const NodeData& node) const;
  };

  Node insert(const NodeData& node);
  Known known_of(const NodeData& node) const;
  Node fold(const NodeData& node);
  /// ∂node/∂a or ∂node/∂b of a computing node.
  Node partial(Node node, bool second);
  Node change_of_choice(const NodeData& choice, Node of_a, Node of_b);
  Node rebuild(const NodeData& node);
  bool may_gather(Node a, Node b) const;

  bool as_written_;
  std::deque<LookupTable> tables_;  // kernels read them in place
  SizeLimits limits_;
  std::vector<NodeData> nodes_;
  std::vector<Known> known_;
  std::unordered_map<NodeData, Node, Hash> index_;
  mutable std::size_t visited_ = 0;  ///< nodes, in all searches while it is built
  bool counting_ = true;
};

/// How many arguments an operation takes: 0 for leaves.
int arity(Op op);

/// x to a whole number of at least 2, in the order of multiplications that compiled code uses as well.
template <class T>
T whole_power(T x, int exponent) {
  T result = x;
  bool started = false;
  for (; exponent > 0; exponent /= 2, x *= x)
    if (exponent % 2 == 1) {
      result = started ? result * x : x;
      started = true;
    }
  return result;
}

}  // namespace diracstep::scene_compiler
