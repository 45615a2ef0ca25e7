#pragma once

#include <diracstep/scene_format/compiler/circuit_formulas.hpp>
#include <diracstep/scene_format/compiler/piece_builder.hpp>
#include <diracstep/scene_format/compiler/scene_program.hpp>
#include <diracstep/scene_format/compiler/sum_terms.hpp>
#include <string>
#include <vector>

namespace diracstep::scene_compiler {

inline bool is_velocity(const NodeData& data) {
  return data.op == Op::coordinate && data.c == static_cast<int>(Role::second);
}

/// What compile_scene() does with a document: every entry becomes functions of the program, with their pieces
/// and kernels.
class SceneCompiler {
 public:
  explicit SceneCompiler(SceneProgram& program)
      : program_(program),
        document_(program.document),
        graph_(program.graph),
        symbols_(program.symbols),
        parser_(document_.file, graph_, symbols_),
        terms_(document_.file, graph_, symbols_),
        circuit_(document_, graph_, symbols_, parser_),
        builder_(graph_, program.known) {}

  void compile();

 private:
  [[noreturn]] void fail(Place place, const std::string& message) const;
  Context mechanics(const std::string& what, char second, std::vector<int> loops = {}) const;
  void declare();
  void declare_spaces();
  void add_as_coordinate(const std::string& name);
  Node own_index(const Symbols::Family& family);
  std::vector<std::string> coordinates() const;
  std::string source_of_tables() const;
  void write_source();

  // Energies and forces.

  Node with_parameters(Node energy);
  bool has_velocity(std::span<const Node> roots) const;
  SceneFunction phase_function(Node whole, const std::string& what, Place place);
  void compile_energies();
  void compile_lagrangian();
  Node compliance(const SceneDocument::Row& row);
  Node unless_rigid(Node compliance, Node value, double at_zero);
  Node extension(const SceneDocument::Row& row);
  Node spring_energy(const SceneDocument::Row& row);
  void compile_force();
  void add_force_terms(SceneFunction& function, Piece& single, const std::vector<Term>& terms, Node target);
  void add_force(SceneFunction& function, Piece& single, const SceneDocument::Entry& entry);
  void add_dissipation(SceneFunction& function, Piece& single);

  // Rows.

  struct Row {
    RowGroup group;
    Node node;
  };

  Node compliant(const SceneDocument::Row& row, Node position);
  void compile_rows();
  Row state_row(const SceneDocument::State& state);
  void require_state_rate(const SceneDocument::State& state, int family, Node rate, const std::string& what);
  bool acts_back(int family);
  bool is_holonomic(const Row& row) const;
  void add_row(SceneFunction& function, Piece& single, const Row& row);
  std::vector<Node> require_linear(const SceneFunction& function, const Piece& piece);

  // The start, references, invariants, outputs and events.

  NamedValue named_value(const SceneDocument::Entry& entry, Context context);
  void compile_start();
  void differentiate_start();
  void compile_guess(const FormulaText& guess);
  void compile_references();
  void compile_invariants();
  SceneFunction value_function(const FormulaText& formula, const std::string& what);
  SceneFunction motion_function(const FormulaText& formula, const std::string& what);
  SceneFunction value_function(const FormulaText& formula, const std::string& what, const Context& context);
  void compile_control(const SceneDocument::Control& control);
  void compile_event(const SceneDocument::Event& event);
  void compile_contact(const SceneDocument::Event& event, EventProgram& program, const std::string& what);
  void compile_drawn(const SceneDocument::DrawnBody& body);
  void require_settable(const NamedValue& value) const;

  SceneProgram& program_;
  SceneDocument& document_;
  FormulaGraph& graph_;
  Symbols& symbols_;
  FormulaParser parser_;
  SumTerms terms_;
  CircuitFormulas circuit_;
  PieceBuilder builder_;
};

}  // namespace diracstep::scene_compiler
