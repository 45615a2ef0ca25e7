#pragma once

#include <diracstep/scene_format/compiler/body_reader.hpp>
#include <diracstep/scene_format/compiler/scene_document.hpp>
#include <diracstep/scene_format/compiler/table_reader.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace diracstep::scene_compiler {

/// Reads the tables of a scene file one after the other; each method throws SceneError for what is wrong.
class DocumentReader : TableReader {
 public:
  DocumentReader(const std::string& file, const std::string& text);
  SceneDocument read(const toml::table& root);

 private:
  SceneDocument::Entry entry(const Item& item) const;
  void require_new_name(const std::string& name, Place place);
  void read_head(const toml::table& root);
  Limits limits(const toml::table& table) const;
  void read_parameters(const toml::table& root, const char* key, bool sizes);
  void add_coordinate(SceneDocument::Coordinate coordinate);
  void read_coordinates(const toml::table& root);

  // Coordinates that are groups and spheres, in document_spaces.cpp.

  /// "SO3" of R = "SO3" and of R = { space = "SO3", … }.
  static std::string factor_of(const Item& item);
  void read_spaces(const toml::table& root, const std::vector<Item>& stated);
  void add_flat_coordinate(const Item& item, const std::string& unit, const std::string& meaning);
  void add_factor(const Item& item, const std::string& kind, const std::string& unit,
                  const std::string& meaning);
  /// Entries of a start or a reference; "R = […]" and "w_R = […]" as those of its numbers.
  void add_entries(std::vector<SceneDocument::Entry>& entries, const Item& item) const;
  std::vector<FormulaText> formulas(const Item& item, std::size_t count) const;
  /// Where a group or a sphere starts, in stored numbers.
  std::vector<FormulaText> place_on(const Item& item, const std::string& kind, std::size_t stored) const;
  /// By axis and angle or by matrix, and by position.
  std::vector<std::string> placed(const Item& item, const toml::table& table, const std::string& kind) const;
  std::vector<std::string> by_matrix(const Item& item, const toml::node& node) const;
  void require_no_spaces(const toml::table& root) const;

  // Bodies: their parts stand behind those of the file, as in the plain scene of plain_scene.hpp.

  void read_bodies(const toml::table& root);
  void add_body_definitions();
  /// And the force and the start.
  void add_body_rows();
  void read_circuit(const toml::table& root);

  // Inputs, states and outputs, in document_inputs.cpp.

  std::vector<double> list(const toml::table& table, const char* key, const std::string& what,
                           Place place) const;
  void read_inputs(const toml::table& root);
  /// Times from the first column of a CSV file and values from the column named, or from the second.
  void read_table_file(const toml::table& entry, const std::string& what, SceneDocument::Input& input) const;
  SceneDocument::Input::Kind input_kind(const toml::table& entry) const;
  void read_states(const toml::table& root);
  void require_no_state(const Item& item) const;
  /// Columns beside t, the coordinates, v_…, p_…, lambda_…, energy and invariant_…, whose names they cannot
  /// have.
  void read_outputs(const toml::table& root);
  void add_output(const std::string& name, const FormulaText& formula, std::optional<Place> stated = {});

  // Rows, the start and what is known of the motion.

  void read_rows(const toml::table& root);
  void add_row(SceneDocument::Row row);
  /// The coordinate of a compliant row, whose start follows from the others'.
  void add_extension(const SceneDocument::Row& row);
  void guess_extensions();
  void read_start(const toml::table& root);
  void read_operating_point(const Item& item, const toml::table& start);
  void read_guesses(const Item& item);
  void read_span(const toml::table& root);
  void read_references(const toml::table& root);
  void read_invariants(const toml::table& root);
  void read_recommended(const toml::table& root);

  // Events, in document_events.cpp.

  void read_events(const toml::table& root);
  /// A contact is approached from one side: from above 0 where nothing is said.
  SceneDocument::Event::Direction direction(const toml::table& event, bool contact) const;
  void require_moment(const toml::table& event, const SceneDocument::Event& stated) const;
  /// "a > b and c < d" as a formula above 0 where it holds.
  std::optional<FormulaText> condition(const toml::table& event) const;
  /// A list of names of rows, or one.
  std::vector<std::string> row_names(const toml::table& event, const char* key) const;

  SceneDocument document_;
  BodyParts bodies_;
  std::set<std::string> names_, row_names_;
  std::vector<std::string> extensions_;
};

}  // namespace diracstep::scene_compiler
