#pragma once

#include <diracstep/scene_format/bodies/mechanism.hpp>
#include <diracstep/scene_format/compiler/scene_document.hpp>
#include <diracstep/scene_format/compiler/table_reader.hpp>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace diracstep::scene_compiler {

/// The tables that make bodies, and the key of their gravity.
inline const std::vector<std::string>& body_tables() {
  static const std::vector<std::string> keys{"gravity", "body", "joint", "wheel", "rolling", "spring"};
  return keys;
}

/// What the tables of bodies are as parts of a plain scene, with their places in the file.
struct BodyParts {
  bodies::Expansion expansion;
  std::vector<Place> places;              ///< of the tables, by the number `source` of the expansion
  std::map<std::string, Place> formulas;  ///< of definitions that stand in the file as they are
  std::vector<SceneDocument::DrawnBody> drawn;
  /// What stands in the place of the file's own, with that of the bodies added.
  std::optional<FormulaText> lagrangian, dissipation;
  std::map<std::string, FormulaText> force;  ///< by coordinate, of entries of the file

  Place place(int source) const {
    return places.empty() ? Place{} : places[static_cast<std::size_t>(source)];
  }
  FormulaText formula(const bodies::Expansion::Named& named) const {
    const auto found = formulas.find(named.name);
    return {named.text, found == formulas.end() ? place(named.source) : found->second};
  }
};

/// Reads bodies, joints, contacts, wheels and springs (docs/bodies.md).  Formulas of places and sizes hold
/// parameters and definitions alone, whose values choose directions and are checked.
class BodyReader {
 public:
  /// Both outlive this; the parameters of the document have been read.
  BodyReader(const TableReader& tables, const std::string& file, const SceneDocument& document);

  /// Throws SceneError; nothing where the file has no body.
  BodyParts read(const toml::table& root);

 private:
  using Formula = bodies::Formula;
  using Vec = bodies::Vec;

  void know_values(const toml::table& root);
  double value_of(const FormulaText& text, const std::string& what);
  Formula formula(const toml::node& node, const std::string& what);
  Formula formula(const toml::table& table, const char* key, const Formula& absent, const std::string& what);
  Formula positive(const toml::table& table, const char* key, const std::string& what, bool zero = false);
  Vec vector(const toml::node& node, const std::string& what, bool plane);
  Vec direction(const toml::node& node, const std::string& what, bool plane);
  std::array<Vec, 2> two(const toml::table& table, const char* key, const std::string& what, bool plane,
                         bool directions);
  std::string name(const toml::table& table, const std::string& what);
  template <class Value>
  static std::string words_of(const std::map<std::string, Value>& all) {
    std::string text;
    for (const auto& [word, value] : all) text += (text.empty() ? "\"" : ", \"") + word + '"';
    return text;
  }
  /// What the word under the key stands for.
  template <class Value>
  const Value& choice(const toml::table& table, const char* key, const std::string& what,
                      const std::map<std::string, Value>& all) const {
    const std::string word = tables_.required_string(table, key, what);
    const auto found = all.find(word);
    if (found == all.end())
      tables_.fail(place_of(table.get(key)->source()), std::string("'") + key + "' = \"" + word + "\" of " +
                                                           what + ": expected " + words_of(all));
    return found->second;
  }
  int source(const toml::table& table);

  void join_formulas(const toml::table& root);
  std::optional<FormulaText> joined(std::optional<FormulaText> own, const std::string& added,
                                    const std::string& name, int source);
  void read_gravity(const toml::table& root);
  void read_body(const toml::table& table);
  void add(bodies::Body body);
  void draw(const bodies::Body& body);
  void read_inertia(const toml::table& table, bodies::Body& body, const std::string& what);
  void read_shape(const toml::table& table, bodies::Body& body, const std::string& what);
  void lay_between(const toml::table& table, bodies::Body& body, const std::string& what);
  Vec end_to_end(const toml::table& table, const bodies::Body& body, const std::string& what);
  void read_orientation(const toml::node& node, bodies::Body& body, const std::string& what);
  bodies::Rotation::Quaternion axis_and_angle(const toml::table& table, const std::string& what);
  bodies::Rotation::Quaternion of_matrix(const toml::array& rows, const std::string& what);
  void require_momenta(const toml::table& root) const;
  void read_joint(const toml::table& table);
  void read_joint_axis(const toml::table& table, bodies::Joint& joint, const std::string& what, bool plane);
  void read_spring(const toml::table& table);
  void read_contact(const toml::table& table);
  void read_wheel(const toml::table& table);
  void read_plane_wheel(const toml::table& table, int body, const std::string& name, int number);
  /// Numbers of two bodies, of one kind; whether that is the plane.
  bool read_between(const toml::table& table, const std::string& what, int& first, int& second);
  void read_ends(const toml::table& table, const std::string& what, bool plane, bodies::SharedVector& point,
                 std::optional<std::array<Vec, 2>>& in_space);
  int body_number(const toml::node& node, const std::string& what, bool or_ground) const;
  bool is_plane(int body) const;

  const TableReader& tables_;
  std::string file_;
  const SceneDocument& document_;
  FormulaGraph graph_;
  Symbols symbols_;
  FormulaParser parser_;
  bodies::Mechanism mechanism_;
  std::map<std::string, int> numbers_;  ///< of bodies by name
  std::set<std::string> names_;
  BodyParts parts_;
};

}  // namespace diracstep::scene_compiler
