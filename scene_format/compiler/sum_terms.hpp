#pragma once

#include <diracstep/scene_format/compiler/formula_graph.hpp>
#include <diracstep/scene_format/compiler/formula_parser.hpp>
#include <string>
#include <unordered_set>
#include <vector>

namespace diracstep::scene_compiler {

/// One addend of a function, with the loops it is summed over.
struct Term {
  std::vector<int> loops;
  Node node;
};

/// Takes formulas of sums apart.
class SumTerms {
 public:
  SumTerms(const std::string& file, FormulaGraph& graph, const Symbols& symbols)
      : file_(file), graph_(graph), symbols_(symbols) {}

  /// The addends of `whole`, none of which holds a sum; those over `outer` alone are one, so that they share
  /// their subexpressions.  Throws SceneError, with `what` and failing all else `place`, where a sum stands
  /// inside a function, a power or a divisor, and where there are more addends than the limit.
  std::vector<Term> of(Node whole, const std::vector<int>& outer, const std::string& what, Place place);

 private:
  std::unordered_set<Node> holding_sums(Node whole) const;
  std::vector<Term> joined(std::vector<Term> terms, const std::vector<int>& outer);
  [[noreturn]] void refuse(Node node, const std::string& what, Place place) const;

  const std::string& file_;
  FormulaGraph& graph_;
  const Symbols& symbols_;
};

}  // namespace diracstep::scene_compiler
