#pragma once

#include <diracstep/scene_format/compiler/scene_document.hpp>
#include <diracstep/scene_format/compiler/table_reader.hpp>
#include <string>
#include <utility>
#include <vector>

namespace diracstep::scene_compiler {

/// The coordinates of a circuit's branches, in their order: "qNAME", the charge that has passed from the
/// first node to the second; "qNAME_c", the charge of the capacitor beside a diode or a resistor given by its
/// current; "fNAME", ∫ of the voltage across one without a capacitor and across an op-amp's output.
std::vector<SceneDocument::Coordinate> coordinates_of(const SceneDocument::Branch& branch);

/// Whether an element's current is a function of the voltage across it: of diodes, and of resistors given so.
bool conducts_by_voltage(const SceneDocument::Branch& branch);

/// Of such an element: whether its 'capacitance' is written as 0.
bool has_no_capacitance(const SceneDocument::Branch& branch);

/// "n" or "n[k-1]", at a place of the file.  Throws SceneError.
SceneDocument::NodeName node_name(const std::string& file, const FormulaText& text);

/// Where currents are given by elements, or some by the start, or the motion starts at the operating point,
/// the start of those that nothing stores is to be found: they become guesses, but for those of inductors and
/// those that the start gives.  Charges of junctions, which follow the voltages across them, likewise.
void guess_starts(SceneDocument& document);

/// Reads the elements of a circuit from the tables of a scene file.
class CircuitReader {
 public:
  /// Both outlive this.
  CircuitReader(const TableReader& tables, SceneDocument& document) : tables_(tables), document_(document) {}

  /// Fills the branches, mutual inductances and two-ports of the document; returns the coordinates.
  std::vector<SceneDocument::Coordinate> read(const toml::table& root);

 private:
  void read_branch(const toml::table& table, const std::string& kind);
  void read_two_port(const toml::table& table, const std::string& kind);
  void read_mutual(const toml::table& table);
  std::pair<FormulaText, FormulaText> two_names(const toml::table& table, const char* key) const;
  std::pair<SceneDocument::NodeName, SceneDocument::NodeName> two_nodes(const toml::table& table,
                                                                        const char* key) const;

  const TableReader& tables_;
  SceneDocument& document_;
};

}  // namespace diracstep::scene_compiler
