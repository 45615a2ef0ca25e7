#pragma once

#include <diracstep/scene_format/compiler/piece_builder.hpp>
#include <diracstep/scene_format/compiler/scene_program.hpp>
#include <set>

namespace diracstep::scene_compiler {

/// Finds in the formulas of a compiled scene where they are not smooth or change fast
/// (core/system/kinks.hpp).
class KinkFinder {
 public:
  KinkFinder(SceneProgram& program, PieceBuilder& builder)
      : program_(program), graph_(program.graph), builder_(builder) {}

  /// Looks through L (or H where there is no L), the force, the rows, and the cost where there is one.
  KinkProgram find();

 private:
  /// An addend of a function: where it stands in loops, and whether its second columns are momenta.
  struct Source {
    const Piece* piece;
    bool momenta;
  };
  void look_through(const Source& source);
  void look_at(Node node, const Source& source);
  void add_switch(SceneFunction& kind, Node g, Node place, const char* what, const Source& source);
  void add_instant(Node event, Node width, const Source& source);
  void add_phase(Node argument, const Source& source);
  /// ∂u/∂t where u depends on the time and on no coordinate; else none.
  Node rate_in_time(Node u);
  bool holds(Node root, Op op, Role role) const;
  std::vector<int> loops_of(Node root, const std::vector<int>& loops) const;
  void add_output(SceneFunction& function, Node output, const std::string& name, const std::vector<int>& all);

  SceneProgram& program_;
  FormulaGraph& graph_;
  PieceBuilder& builder_;
  struct Dependence {
    bool time, coordinates;
  };

  KinkProgram found_;
  std::vector<Dependence> dependence_;  ///< of the graph's nodes, as far as was asked
  std::set<Node> seen_;
};

}  // namespace diracstep::scene_compiler
