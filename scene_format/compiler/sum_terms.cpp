#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/sum_terms.hpp>

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
  const std::vector<bool> with_sum = holds_sum(whole);
  const auto has_sum = [&](Node node) { return with_sum[static_cast<std::size_t>(node)]; };
  std::vector<Term> terms;
  std::vector<Part> parts{{whole, graph_.number(1.0), outer}};
  while (!parts.empty()) {
    Part part = parts.back();
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

/// Of each node of the formula, by its number.
std::vector<bool> SumTerms::holds_sum(Node whole) const {
  std::vector<bool> with_sum;
  const auto holds = [&](Node node) { return with_sum[static_cast<std::size_t>(node)]; };
  for (const Node node : graph_.reachable(std::span(&whole, 1))) {  // arguments first
    const NodeData& data = graph_[node];
    const int arguments = arity(data.op);
    const auto number = static_cast<std::size_t>(node);
    if (number >= with_sum.size()) with_sum.resize(number + 1);
    with_sum[number] =
        data.op == Op::sum || (arguments >= 1 && holds(data.a)) || (arguments == 2 && holds(data.b));
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
