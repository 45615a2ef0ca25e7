#pragma once

#include <diracstep/scene_format/compiler/detail/netlist_text.hpp>
#include <map>
#include <optional>

namespace diracstep::scene_compiler {

/// The `.model` lines of a netlist, of diodes, D, and of switches that a voltage closes, SW.
class NetlistModels {
 public:
  /// The text outlives this.
  explicit NetlistModels(const NetlistText& text) : text_(text) {}

  /// Notes what a model has and a diode here has not.
  void read(const Words& line, std::vector<std::string>& notes);

  /// Fills the values of a diode that names a model; returns its series resistance, if it has one.
  std::optional<FormulaText> fill_diode(const Word& name, SceneDocument::Branch& diode) const;
  /// Fills the values of a switch that a voltage, as a formula, closes above VT of the model.
  void fill_switch(const Word& name, const std::string& voltage, SceneDocument::Branch& branch) const;

 private:
  struct Model {
    std::string type;
    std::map<std::string, FormulaText> values;

    std::optional<FormulaText> get(const char* key) const;
  };

  const Model& find(const Word& name, const char* type) const;
  void add_value(const Words& line, std::size_t k, Model& model, std::string& left_out) const;

  const NetlistText& text_;
  std::map<std::string, Model> models_;
};

}  // namespace diracstep::scene_compiler
