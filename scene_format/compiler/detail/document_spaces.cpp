#include <fmt/format.h>

#include <array>
#include <diracstep/scene_format/compiler/detail/document_reader.hpp>
#include <diracstep/scene_format/spaces/factor_texts.hpp>

namespace diracstep::scene_compiler {

std::string DocumentReader::factor_of(const Item& item) {
  const toml::node* node = item.node->is_table() ? item.node->as_table()->get("space") : item.node;
  return node != nullptr && node->is_string() ? node->as_string()->get() : "";
}

void DocumentReader::read_spaces(const toml::table& root, const std::vector<Item>& stated) {
  for (const char* key : {"hamiltonian", "states", "events", "sizes"})
    if (root.contains(key))
      fail(place_of(root.get(key)->source()),
           fmt::format("'{}' is for scenes in R^n; here a coordinate is a group or a sphere", key));
  for (const Item& item : stated) {
    std::string kind = factor_of(item), unit, meaning;
    if (item.node->is_table()) {
      const toml::table& entry = *item.node->as_table();
      check_keys(entry, "coordinate '" + item.key + "' beside groups and spheres",
                 {"space", "unit", "meaning"});
      unit = string(entry, "unit");
      meaning = string(entry, "meaning");
    } else if (kind.empty()) {
      table(item, "R = \"SO3\"");
    }
    if (kind.empty())
      add_flat_coordinate(item, unit, meaning);
    else
      add_factor(item, kind, unit, meaning);
  }
}

void DocumentReader::add_flat_coordinate(const Item& item, const std::string& unit,
                                         const std::string& meaning) {
  add_coordinate({item.key, unit, meaning, {}, false, item.place});
  document_.spaces.kinds.emplace_back("R1");
  document_.spaces.components.push_back(item.key);
  document_.spaces.rates.push_back({"v_" + item.key, item.place});
}

void DocumentReader::add_factor(const Item& item, const std::string& kind, const std::string& unit,
                                const std::string& meaning) {
  if (!spaces::is_factor(kind))
    fail(item.place, fmt::format("'{}' is no space; there are {}", kind, spaces::factor_kinds()));
  for (const std::string& name : {item.key, "v_" + item.key, "w_" + item.key})
    require_new_name(name, item.place);
  const spaces::FactorTexts texts = spaces::factor_texts(kind, item.key);
  SceneDocument::Spaces& all = document_.spaces;
  all.kinds.push_back(kind);
  all.kind_of.emplace(item.key, kind);
  for (const std::string& stored : texts.stored)
    add_coordinate({stored, unit, meaning, {}, false, item.place});
  for (const std::string& component : texts.components) {
    for (const char* prefix : {"", "v_", "p_"}) names_.insert(prefix + component);
    all.components.push_back(component);
  }
  for (const auto& [entry, text] : texts.entries) all.entries.emplace(entry, FormulaText{text, item.place});
  for (const auto& [definition, text] : texts.definitions) {
    require_new_name(definition, item.place);
    document_.definitions.emplace(definition, FormulaText{text, item.place});
  }
  for (const std::string& rate : texts.rates) all.rates.push_back({rate, item.place});
}

void DocumentReader::add_entries(std::vector<SceneDocument::Entry>& entries, const Item& item) const {
  const auto& kinds = document_.spaces.kind_of;
  const bool rate = item.key.starts_with("w_") || item.key.starts_with("v_");
  const std::string name = rate ? item.key.substr(2) : item.key;
  const auto found = kinds.find(name);
  if (found == kinds.end()) return entries.push_back(entry(item));
  const spaces::FactorTexts texts = spaces::factor_texts(found->second, name);
  const bool flat = texts.stored == texts.components;
  if (rate && flat == item.key.starts_with("w_"))
    fail(item.place, fmt::format("'{}': the velocity of {} = \"{}\" is stated as {}_{}", item.key, name,
                                 found->second, flat ? 'v' : 'w', name));
  const std::vector<FormulaText> values =
      rate ? formulas(item, texts.components.size()) : place_on(item, found->second, texts.stored.size());
  const std::vector<std::string>& names = rate ? texts.components : texts.stored;
  for (std::size_t i = 0; i < names.size(); ++i)
    entries.push_back({{(rate ? "v_" : "") + names[i], item.place}, {values[i]}, false});
}

std::vector<FormulaText> DocumentReader::formulas(const Item& item, std::size_t count) const {
  const toml::array* list = item.node->as_array();
  if (list == nullptr || list->size() != count)
    fail(item.place, fmt::format("'{}': expected a list of {} numbers or formulas", item.key, count));
  std::vector<FormulaText> values;
  for (const toml::node& node : *list) values.push_back(formula(node, item.key));
  return values;
}

std::vector<FormulaText> DocumentReader::place_on(const Item& item, const std::string& kind,
                                                  std::size_t stored) const {
  const auto at_item = [&](const std::vector<std::string>& texts) {
    std::vector<FormulaText> values;
    for (const std::string& text : texts) values.push_back({text, item.place});
    return values;
  };
  const auto three = [&](const Item& list) {
    const auto of = formulas(list, 3);
    return std::array{of[0].text, of[1].text, of[2].text};
  };
  if (kind == "S2" && !item.node->is_table()) return at_item(spaces::frame_of(three(item)));
  if (kind == "S1" && !item.node->is_array()) {
    const std::string angle = formula(*item.node, item.key).text;
    return at_item({"cos(" + angle + ")", "sin(" + angle + ")"});
  }
  if (!item.node->is_table()) return formulas(item, stored);
  const toml::table& table = *item.node->as_table();
  if (kind != "SO3" && kind != "SE3" && kind != "SE2")
    fail(item.place, fmt::format("'{}' = \"{}\" starts by a list of numbers", item.key, kind));
  return at_item(placed(item, table, kind));
}

std::vector<std::string> DocumentReader::placed(const Item& item, const toml::table& table,
                                                const std::string& kind) const {
  check_keys(table, "the start of '" + item.key + "'",
             kind == "SO3"   ? std::vector<std::string>{"axis", "angle", "matrix"}
             : kind == "SE3" ? std::vector<std::string>{"axis", "angle", "matrix", "position"}
                             : std::vector<std::string>{"angle", "position"});
  const auto list = [&](const char* key, std::size_t count) {
    std::vector<std::string> texts;
    if (!table.contains(key)) return std::vector<std::string>(count, "0");
    for (const FormulaText& text : formulas({key, item.place, table.get(key)}, count))
      texts.push_back(text.text);
    return texts;
  };
  const auto angle = optional_formula(table, "angle");
  const std::string turn = angle ? angle->text : "0";
  std::vector<std::string> texts;
  if (kind == "SE2") {
    texts = {"cos(" + turn + ")", "sin(" + turn + ")"};
  } else if (table.contains("matrix")) {
    if (angle || table.contains("axis"))
      fail(item.place, fmt::format("'{}' starts by 'axis' and 'angle' or by 'matrix', not both", item.key));
    texts = by_matrix(item, *table.get("matrix"));
  } else if (angle.has_value() != table.contains("axis")) {
    fail(item.place, fmt::format("'{}' starts by 'axis' and 'angle', and one is missing", item.key));
  } else {
    const std::vector<std::string> axis = list("axis", 3);
    texts = angle ? spaces::turn_about({axis[0], axis[1], axis[2]}, turn)
                  : std::vector<std::string>{"1", "0", "0", "0"};
  }
  if (kind != "SO3")
    for (const std::string& text : list("position", kind == "SE3" ? 3 : 2)) texts.push_back(text);
  return texts;
}

std::vector<std::string> DocumentReader::by_matrix(const Item& item, const toml::node& node) const {
  const std::string expected = fmt::format("'{}': expected matrix = [[…], […], […]], nine numbers", item.key);
  const toml::array* rows = node.as_array();
  if (rows == nullptr || rows->size() != 3) fail(item.place, expected);
  std::array<std::array<double, 3>, 3> matrix{};
  for (std::size_t i = 0; i < 3; ++i) {
    const toml::array* row = (*rows)[i].as_array();
    if (row == nullptr || row->size() != 3) fail(item.place, expected);
    for (std::size_t j = 0; j < 3; ++j) matrix[i][j] = number((*row)[j], item.key);
  }
  const auto q = spaces::quaternion_of(matrix);
  if (!q)
    fail(item.place, fmt::format("'{}': the matrix is no rotation: its columns are not of length 1, not "
                                 "perpendicular or left-handed",
                                 item.key));
  std::vector<std::string> texts;
  for (const double one : *q) texts.push_back(fmt::format("{:.17g}", one));
  return texts;
}

void DocumentReader::require_no_spaces(const toml::table& root) const {
  if (document_.spaces.kinds.empty()) return;
  const char* const refused = "beside coordinates that are groups and spheres";
  if (!document_.branches.empty() || !bodies_.expansion.coordinates.empty() || !document_.bodies.empty())
    fail(place_of(root.source()), fmt::format("circuits and bodies do not stand {}", refused));
  for (const auto& row : document_.rows)
    if (row.compliance || row.loops)
      fail(row.place, fmt::format("repeated and compliant rows do not stand {}", refused));
  if (document_.project || !document_.guesses.empty())
    fail(place_of(root.get("start")->source()),
         fmt::format("'guess' and 'project' do not stand {}; state a start on the rows", refused));
}

}  // namespace diracstep::scene_compiler
