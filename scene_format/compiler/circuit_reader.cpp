#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/circuit_reader.hpp>

namespace diracstep::scene_compiler {

namespace {

/// The sets of keys that say what a branch of a kind is, one of which is to be complete, and keys that may be
/// left out.
struct ElementKeys {
  const char* kind;
  std::vector<std::vector<std::string>> laws;
  std::vector<std::string> others = {};
};

const std::vector<ElementKeys>& element_keys() {
  static const std::vector<ElementKeys> keys{
      {"inductor", {{"value"}}},
      {"capacitor", {{"value"}, {"energy"}}},
      {"resistor", {{"value"}, {"voltage"}, {"current"}}, {"capacitance"}},
      {"source_voltage", {{"value"}}},
      {"source_current", {{"value"}}},
      {"diode",
       {{"saturation"}, {"on", "off"}},
       {"thermal_voltage", "threshold", "capacitance", "breakdown_voltage", "breakdown_current"}},
      {"switch", {{"closed", "on", "off"}}},
      {"opamp", {{}}}};
  return keys;
}

bool all_in(const std::vector<std::string>& law, const toml::table& table) {
  return std::ranges::all_of(law, [&](const std::string& key) { return table.contains(key); });
}

std::string laws_text(const ElementKeys& element) {
  std::string text;
  for (const auto& law : element.laws) {
    text += text.empty() ? "" : ", or ";
    for (std::size_t k = 0; k < law.size(); ++k) text += fmt::format("{}'{}'", k == 0 ? "" : " and ", law[k]);
  }
  return text;
}

}  // namespace

bool conducts_by_voltage(const SceneDocument::Branch& branch) {
  return branch.kind == "diode" || branch.has("current");
}

bool has_no_capacitance(const SceneDocument::Branch& branch) {
  const auto stated = branch.values.find("capacitance");
  return stated != branch.values.end() && stated->second.text.find_first_not_of("0. ") == std::string::npos;
}

std::vector<SceneDocument::Coordinate> coordinates_of(const SceneDocument::Branch& branch) {
  std::vector<SceneDocument::Coordinate> all;
  const std::string what = branch.kind + ' ' + branch.name;
  all.push_back({"q" + branch.name, "C", "charge through " + what, branch.loops, false, branch.place});
  const bool by_voltage = conducts_by_voltage(branch), at_once = by_voltage && has_no_capacitance(branch);
  if (by_voltage && !at_once)
    all.push_back({"q" + branch.name + "_c", "C", "charge on the capacitance of " + what, branch.loops, false,
                   branch.place});
  if (at_once || branch.kind == "opamp")
    all.push_back(
        {"f" + branch.name, "V s",
         (at_once ? "integral of the voltage across " : "integral of the voltage across the output of ") +
             what,
         branch.loops, false, branch.place});
  return all;
}

SceneDocument::NodeName node_name(const std::string& file, const FormulaText& text) {
  const std::size_t bracket = text.text.find('[');
  if (text.text.empty()) throw SceneError(file, text.start, "a node without a name");
  if (bracket == std::string::npos) return {text.text};
  if (bracket == 0 || !text.text.ends_with(']'))
    throw SceneError(
        file, text.start,
        fmt::format("'{}' is no node: expected a name, or a name and an index, \"n[k-1]\"", text.text));
  return {
      text.text.substr(0, bracket),
      FormulaText{text.text.substr(bracket + 1, text.text.size() - bracket - 2), text.place(bracket + 1)}};
}

void guess_starts(SceneDocument& document) {
  const bool by_elements = std::ranges::any_of(document.branches, [](const auto& branch) {
    return branch.kind == "source_current" || coordinates_of(branch).size() > 1;
  });
  const bool stated_currents = std::ranges::any_of(
      document.start, [](const auto& entry) { return entry.key.text.starts_with("v_q"); });
  if (document.project || !(by_elements || stated_currents || document.operating_point)) return;
  const auto stated = [&](const std::string& name) {
    return std::ranges::any_of(document.start, [&](const auto& entry) { return entry.key.text == name; }) ||
           std::ranges::any_of(document.guesses, [&](const auto& guess) { return guess.text == name; });
  };
  for (const auto& branch : document.branches)
    for (const auto& coordinate : coordinates_of(branch)) {
      const std::string velocity = "v_" + coordinate.name;
      if (branch.kind != "inductor" && !stated(velocity))
        document.guesses.push_back({velocity, branch.place});
      // the charge of a junction follows the voltage across it
      if (coordinate.name == "q" + branch.name + "_c" && !stated(coordinate.name))
        document.guesses.push_back({coordinate.name, branch.place});
    }
}

std::vector<SceneDocument::Coordinate> CircuitReader::read(const toml::table& root) {
  for (const ElementKeys& element : element_keys())
    for (const toml::table* branch : tables_.tables(root, element.kind)) read_branch(*branch, element.kind);
  for (const char* kind : {"transformer", "gyrator"})
    for (const toml::table* table : tables_.tables(root, kind)) read_two_port(*table, kind);
  std::ranges::stable_sort(document_.branches, [](const auto& a, const auto& b) {
    return std::pair(a.place.line, a.place.column) < std::pair(b.place.line, b.place.column);
  });
  for (const toml::table* mutual : tables_.tables(root, "mutual")) read_mutual(*mutual);
  std::vector<SceneDocument::Coordinate> all;
  for (const auto& branch : document_.branches)
    for (SceneDocument::Coordinate& coordinate : coordinates_of(branch)) all.push_back(std::move(coordinate));
  return all;
}

void CircuitReader::read_branch(const toml::table& table, const std::string& kind) {
  const std::string what = "[[" + kind + "]]";
  const ElementKeys& element = *std::ranges::find(element_keys(), kind, &ElementKeys::kind);
  std::vector<std::string> values = element.others, known{"name", "nodes", "for"};
  for (const auto& law : element.laws) values.insert(values.end(), law.begin(), law.end());
  known.insert(known.end(), values.begin(), values.end());
  if (kind == "opamp") known.emplace_back("inputs");
  tables_.check_keys(table, what, known);
  const Place place = place_of(table.source());
  const auto [from, to] = two_nodes(table, "nodes");
  SceneDocument::Branch branch{kind, tables_.required_string(table, "name", what), from, to, {}, {}, place};
  branch.loops = tables_.optional_formula(table, "for");
  const auto stated =
      std::ranges::count_if(element.laws, [&](const auto& law) { return all_in(law, table); });
  if (stated != 1)
    tables_.fail(place, fmt::format("{} needs {}{}", what, laws_text(element),
                                    stated > 1 ? ", not several of these" : ""));
  for (const std::string& key : values)
    if (const auto text = tables_.optional_formula(table, key.c_str())) branch.values.emplace(key, *text);
  if (branch.has("capacitance") && kind == "resistor" && !branch.has("current"))
    tables_.fail(place, "'capacitance' of a [[resistor]] stands beside 'current' only");
  if (branch.has("breakdown_current") && !branch.has("breakdown_voltage"))
    tables_.fail(place, "'breakdown_current' stands beside 'breakdown_voltage'");
  if (kind == "opamp") std::tie(branch.plus, branch.minus) = two_nodes(table, "inputs");
  document_.branches.push_back(std::move(branch));
}

void CircuitReader::read_two_port(const toml::table& table, const std::string& kind) {
  const std::string what = "[[" + kind + "]]";
  const char* key = kind == "transformer" ? "ratio" : "resistance";
  tables_.check_keys(table, what, {"name", "nodes", "secondary", key});
  const Place place = place_of(table.source());
  const SceneDocument::TwoPort port{kind, tables_.required_string(table, "name", what),
                                    tables_.required_formula(table, key, what), place};
  int side = 0;
  for (const char* nodes : {"nodes", "secondary"}) {
    const auto [from, to] = two_nodes(table, nodes);
    document_.branches.push_back({"port", port.side(++side), from, to, {}, {}, place});
  }
  document_.two_ports.push_back(port);
}

void CircuitReader::read_mutual(const toml::table& table) {
  tables_.check_keys(table, "[[mutual]]", {"between", "value", "coefficient"});
  const Place place = place_of(table.source());
  const auto [first, second] = two_names(table, "between");
  const bool coefficient = table.contains("coefficient");
  if (coefficient == table.contains("value"))
    tables_.fail(place, "[[mutual]] needs 'value', M in H, or 'coefficient', k of M = k sqrt(L1 L2)");
  document_.mutuals.push_back(
      {first.text, second.text,
       tables_.required_formula(table, coefficient ? "coefficient" : "value", "[[mutual]]"), coefficient,
       place});
}

std::pair<FormulaText, FormulaText> CircuitReader::two_names(const toml::table& table,
                                                             const char* key) const {
  const toml::node* node = table.get(key);
  const toml::array* array = node == nullptr ? nullptr : node->as_array();
  if (array == nullptr || array->size() != 2 || !(*array)[0].is_string() || !(*array)[1].is_string())
    tables_.fail(place_of(table.source()), fmt::format("expected {} = [\"a\", \"b\"]", key));
  return {tables_.formula((*array)[0], key), tables_.formula((*array)[1], key)};
}

std::pair<SceneDocument::NodeName, SceneDocument::NodeName> CircuitReader::two_nodes(const toml::table& table,
                                                                                     const char* key) const {
  const auto [first, second] = two_names(table, key);
  if (first.text == second.text)
    tables_.fail(place_of(table.source()), fmt::format("'{}' joins a node to itself", key));
  return {node_name(document_.file, first), node_name(document_.file, second)};
}

}  // namespace diracstep::scene_compiler
