#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <diracstep/scene_format/compiler/sum_terms.hpp>
#include <utility>

namespace diracstep::scene_compiler {

namespace {

/// An addend that may still be taken apart: factor · node, summed over the loops.
struct Part {
  Node node, factor;
  std::vector<int> loops;
};

}  // namespace

std::vector<Term> SumTerms::of(Node whole, const std::vector<int>& outer, const std::string& what,
                               Place place) {
  const std::unordered_set<Node> with_sum = holding_sums(whole);
  const auto has_sum = [&](Node node) { return with_sum.contains(node); };
  const std::size_t most = size_limits().sum_terms;
  std::size_t taken_apart = 0;
  std::vector<Term> terms;
  std::vector<Part> parts{{whole, graph_.number(1.0), outer}};
  while (!parts.empty()) {
    if (++taken_apart > most)  // definitions that use each other twice double their terms
      throw SceneError(
          file_, place,
          fmt::format("the sums in {} have more than {} terms when they are taken apart, the limit", what,
                      most));
    Part part = std::move(parts.back());
    parts.pop_back();
    const NodeData data = graph_[part.node];
    if (!has_sum(part.node)) {
      terms.push_back({part.loops, graph_.multiply(part.factor, part.node)});
    } else if (data.op == Op::sum) {
      part.loops.push_back(data.b);
      parts.push_back({data.a, part.factor, part.loops});
    } else if (data.op == Op::add || data.op == Op::subtract) {
      const Node second = data.op == Op::add ? part.factor : graph_.negative(part.factor);
      parts.push_back({data.b, second, part.loops});
      parts.push_back({data.a, part.factor, part.loops});
    } else if (data.op == Op::negative) {
      parts.push_back({data.a, graph_.negative(part.factor), part.loops});
    } else if (data.op == Op::multiply && !(has_sum(data.a) && has_sum(data.b))) {
      const bool first = has_sum(data.a);
      parts.push_back(
          {first ? data.a : data.b, graph_.multiply(part.factor, first ? data.b : data.a), part.loops});
    } else if (data.op == Op::divide && !has_sum(data.b)) {
      parts.push_back({data.a, graph_.divide(part.factor, data.b), part.loops});
    } else {
      refuse(part.node, what, place);
    }
  }
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
