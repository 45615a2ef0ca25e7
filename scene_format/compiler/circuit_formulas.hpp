#pragma once

#include <diracstep/scene_format/compiler/formula_parser.hpp>
#include <diracstep/scene_format/compiler/scene_document.hpp>
#include <string>
#include <utility>
#include <vector>

namespace diracstep::scene_compiler {

/// The formulas of the branches of a circuit; the charges through the branches are the coordinates "qNAME".
class CircuitFormulas {
 public:
  CircuitFormulas(const SceneDocument& document, FormulaGraph& graph, const Symbols& symbols,
                  FormulaParser& parser)
      : document_(document), graph_(graph), symbols_(symbols), parser_(parser) {}

  /// Σ ½ L i² + Σ M i i' − Σ q²/(2C) + Σ V q.
  Node lagrangian();
  /// ½ R i² of the resistors.
  Node dissipation();
  /// Kirchhoff's current law at the nodes where it does not follow from the others, with their names.
  std::vector<std::pair<std::string, Node>> current_laws();

 private:
  Node coordinate(const std::string& branch, Place place, Role role);
  Node value(const FormulaText& text, const std::string& what);

  const SceneDocument& document_;
  FormulaGraph& graph_;
  const Symbols& symbols_;
  FormulaParser& parser_;
};

}  // namespace diracstep::scene_compiler
