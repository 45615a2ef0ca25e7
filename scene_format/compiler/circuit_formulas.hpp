#pragma once

#include <diracstep/scene_format/compiler/formula_parser.hpp>
#include <diracstep/scene_format/compiler/scene_document.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace diracstep::scene_compiler {

/// The formulas of the branches of a circuit.  The charges through the branches are the coordinates "qNAME",
/// in C; the voltage of a branch, from its first node to its second, is
///
///   u = d/dt ∂L/∂v − ∂L/∂q − f,
///
/// and Kirchhoff's current law makes the rows.  What gives a current as a function of a voltage has that
/// voltage as a position, on a capacitor beside it, and its current as a row of its own.  Without a
/// capacitor, and for sources whose current depends on other currents, and op-amps, there is a coordinate
/// "fNAME" without mass, ∫u dt in V s, with forces −v_f on the charge and v_q − I on f: rows would act back
/// on what controls them.
class CircuitFormulas {
 public:
  CircuitFormulas(SceneDocument& document, FormulaGraph& graph, Symbols& symbols, FormulaParser& parser);

  /// A force on one coordinate, repeated over its loops.
  struct ForceOn {
    int family;
    std::vector<int> loops;
    Node force;
    Place place;
    std::string what;
  };
  /// A row v = …, and one for each turn of its loops.
  struct Row {
    std::string name, origin;
    std::vector<int> loops;
    Node node;
    Place place;
  };

  /// Adds the coordinates that only the formulas of sources tell; before anything else.
  void declare();
  /// Σ ½ L i² + Σ M i i' − Σ q²/(2C) + Σ V q.
  Node lagrangian();
  /// ½ R i² of the resistors.
  Node dissipation();
  std::vector<ForceOn> forces();
  /// Currents that are given, ratios of transformers, and Kirchhoff's current law at the nodes where it does
  /// not follow from the others.
  std::vector<Row> rows();

 private:
  using Branch = SceneDocument::Branch;
  /// A node of the circuit, with its index where nodes are repeated.
  using At = CircuitQuery::Name;

  [[noreturn]] void fail(Place place, const std::string& message) const;
  const Branch& branch(const std::string& name, Place place) const;
  int family(const std::string& coordinate) const { return symbols_.family(coordinate); }
  std::vector<int> loops(const Branch& branch) const;
  Node own_index(const Branch& branch);
  Node charge(const Branch& branch, Node index);
  Node current(const Branch& branch, Node index);
  Node total_current(const Branch& branch, Node index);
  Node stored_charge(const Branch& branch, Node index);

  Context context(const Branch& branch, Node index, const std::string& key, bool motion) const;
  Node value(const Branch& branch, Node index, const std::string& key, bool motion = false);
  Node value_or(const Branch& branch, Node index, const std::string& key, double absent);
  Node resistance(const Branch& branch, Node index);
  Node capacitance(const Branch& branch, Node index);
  Node capacitor_energy(const Branch& branch, Node index);
  Node conducted(const Branch& branch, Node index);
  Node source_value(const Branch& branch, Node index) { return value(branch, index, "value", true); }
  Node summed(const Branch& branch, Node term);
  bool has_flux(const Branch& branch) const { return family("f" + branch.name) != none; }
  bool holds(Node root, bool velocities_only) const;
  Node at_rest(Node root);

  Node answer(const CircuitQuery& query);
  Node voltage(const At& from, const At& to, Place place);
  Node path(const At& from, const At& to, bool positions_only);
  Node drop(const Branch& branch, Node index, bool positions_only);
  Node element_voltage(const Branch& branch, Node index);
  Node node_index(const Branch& branch, const SceneDocument::NodeName& node, Node index);
  Node shift(const Branch& branch, const SceneDocument::NodeName& node);
  At place_of(const Branch& branch, const SceneDocument::NodeName& node, Node index);
  std::pair<bool, Node> index_at(const Branch& branch, const SceneDocument::NodeName& node, Node index);

  void add_current_laws(std::vector<Row>& rows);
  Row repeated_law(const std::string& name);
  Node inflow(const Branch& branch, const SceneDocument::NodeName& node, Node at);

  SceneDocument& document_;
  FormulaGraph& graph_;
  Symbols& symbols_;
  FormulaParser& parser_;
  std::set<std::string> being_asked_;  ///< branches whose voltage is being made
};

}  // namespace diracstep::scene_compiler
