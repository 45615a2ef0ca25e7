#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <diracstep/scene_format/compiler/sum_terms.hpp>
#include <functional>
#include <map>
#include <utility>

namespace diracstep::scene_compiler {

namespace {

/// What a node is summed over, and what the sum is multiplied by.  The largest node comes first, so that all
/// that holds a node has been taken apart before it is, and a node that is used often is so but once.
using Parts = std::map<std::pair<Node, std::vector<int>>, Node, std::greater<>>;

}  // namespace

std::vector<Term> SumTerms::of(Node whole, const std::vector<int>& outer, const std::string& what,
                               Place place) {
  const std::unordered_set<Node> with_sum = holding_sums(whole);
  const auto has_sum = [&](Node node) { return with_sum.contains(node); };
  const std::size_t most = size_limits().sum_terms;
  std::size_t taken_apart = 0;
  std::vector<Term> terms;
  Parts parts{{{whole, outer}, graph_.number(1.0)}};
  const auto add = [&](Node node, std::vector<int> loops, Node factor) {
    const auto [found, added] = parts.try_emplace({node, std::move(loops)}, factor);
    if (!added) found->second = graph_.add(found->second, factor);
  };
  while (!parts.empty()) {
    if (++taken_apart > most)  // two loops in each of many nested definitions double the terms each time
      throw SceneError(
          file_, place,
          fmt::format("the sums in {} have more than {} terms when they are taken apart, the limit", what,
                      most));
    const auto part = parts.extract(parts.begin());
    const auto& [node, loops] = part.key();
    const Node factor = part.mapped();
    const NodeData data = graph_[node];
    if (!has_sum(node)) {
      terms.push_back({loops, graph_.multiply(factor, node)});
    } else if (data.op == Op::sum) {
      std::vector<int> inner = loops;
      inner.push_back(data.b);
      add(data.a, std::move(inner), factor);
    } else if (data.op == Op::add || data.op == Op::subtract) {
      add(data.b, loops, data.op == Op::add ? factor : graph_.negative(factor));
      add(data.a, loops, factor);
    } else if (data.op == Op::negative) {
      add(data.a, loops, graph_.negative(factor));
    } else if (data.op == Op::multiply && !(has_sum(data.a) && has_sum(data.b))) {
      const bool first = has_sum(data.a);
      add(first ? data.a : data.b, loops, graph_.multiply(factor, first ? data.b : data.a));
    } else if (data.op == Op::divide && !has_sum(data.b)) {
      add(data.a, loops, graph_.divide(factor, data.b));
    } else {
      refuse(node, what, place);
    }
  }
  std::ranges::reverse(terms);  // as they stand in the file
  return joined(std::move(terms), outer);
}

/// The nodes of the formula that are a sum or have one among their arguments.
std::unordered_set<Node> SumTerms::holding_sums(Node whole) const {
  std::unordered_set<Node> with_sum;
  for (const Node node : graph_.reachable(std::span(&whole, 1))) {  // arguments first
    const NodeData& data = graph_[node];
    const int arguments = arity(data.op);
    if (data.op == Op::sum || (arguments >= 1 && with_sum.contains(data.a)) ||
        (arguments == 2 && with_sum.contains(data.b)))
      with_sum.insert(node);
  }
  return with_sum;
}

std::vector<Term> SumTerms::joined(std::vector<Term> terms, const std::vector<int>& outer) {
  std::vector<Term> result;
  Node plain = none;
  for (Term& term : terms) {
    if (graph_.is_number(term.node, 0.0)) continue;
    if (term.loops == outer)
      plain = plain == none ? term.node : graph_.add(plain, term.node);
    else
      result.push_back(std::move(term));
  }
  if (plain != none) result.insert(result.begin(), {outer, plain});
  return result;
}

void SumTerms::refuse(Node node, const std::string& what, Place place) const {
  const auto found = symbols_.places.find(node);
  const bool known = found != symbols_.places.end() && found->second.line > 0;
  throw SceneError(file_, known ? found->second : place,
                   fmt::format("a sum may be added to others and multiplied by what holds no sum, but not "
                               "stand inside a function, a power or a divisor ({})",
                               what));
}

}  // namespace diracstep::scene_compiler
