#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/compiler/circuit_reader.hpp>
#include <diracstep/scene_format/compiler/detail/document_reader.hpp>
#include <diracstep/scene_format/compiler/input_table.hpp>

namespace diracstep::scene_compiler {

DocumentReader::DocumentReader(const std::string& file, const std::string& text) : TableReader(file, text) {
  document_.file = file;
}

SceneDocument DocumentReader::read(const toml::table& root) {
  std::vector<std::string> known{
      "name",        "class",       "description", "source",   "needs",          "lagrangian",
      "hamiltonian", "dissipation", "coordinates", "sizes",    "parameters",     "definitions",
      "rows",        "force",       "start",       "span",     "reference",      "invariants",
      "recommended", "inductor",    "capacitor",   "resistor", "source_voltage", "mutual",
      "redundant",   "outputs",     "states",      "inputs",   "events",         "source_current",
      "diode",       "switch",      "transformer", "gyrator",  "opamp",          "control"};
  known.insert(known.end(), body_tables().begin(), body_tables().end());
  check_keys(root, "the scene", known);
  read_head(root);
  read_parameters(root, "sizes", true);
  read_parameters(root, "parameters", false);
  read_coordinates(root);
  read_bodies(root);
  read_circuit(root);
  read_states(root);
  for (const Item& item : items(root, "definitions")) {
    require_new_name(item.key, item.place);
    document_.definitions.emplace(item.key, formula(*item.node, item.key));
  }
  add_body_definitions();
  read_inputs(root);
  read_rows(root);
  for (const Item& item : items(root, "force")) document_.force.push_back(entry(item));
  read_start(root);
  add_body_rows();
  read_span(root);
  read_references(root);
  read_invariants(root);
  read_outputs(root);
  for (const auto& output : bodies_.expansion.outputs) add_output(output.name, bodies_.formula(output));
  document_.control = read_control(*this, root, document_.parameters);
  read_events(root);
  read_recommended(root);
  guess_starts(document_);
  guess_extensions();
  require_no_spaces(root);
  return std::move(document_);
}

SceneDocument::Entry DocumentReader::entry(const Item& item) const {
  SceneDocument::Entry entry{{item.key, item.place}, {}, item.node->is_array()};
  if (entry.array)
    for (const auto& element : *item.node->as_array()) entry.values.push_back(formula(element, item.key));
  else
    entry.values.push_back(formula(*item.node, item.key));
  return entry;
}

void DocumentReader::require_new_name(const std::string& name, Place place) {
  if (!is_name(name))
    fail(place,
         fmt::format("'{}' is no name: expected a letter, then at most 63 letters, digits and _", name));
  if (is_reserved(name))
    fail(place, fmt::format("the name '{}' is taken by the format; choose another", name));
  if (!names_.insert(name).second) fail(place, fmt::format("the name '{}' is used twice", name));
}

void DocumentReader::read_head(const toml::table& root) {
  document_.name = required_string(root, "name", "a scene");
  if (!is_name(document_.name))
    fail(place_of(root.get("name")->source()),
         fmt::format("name = \"{}\": expected letters, digits and _ only", document_.name));
  document_.kind = string(root, "class");
  document_.description = string(root, "description");
  document_.source = string(root, "source");
  document_.needs = string(root, "needs");
  const std::string redundant = string(root, "redundant", "drop");
  if (redundant != "drop" && redundant != "refuse")
    fail(place_of(root.get("redundant")->source()), "'redundant': expected \"drop\" or \"refuse\"");
  document_.drop_redundant_rows = redundant == "drop";
  document_.lagrangian = optional_formula(root, "lagrangian");
  document_.hamiltonian = optional_formula(root, "hamiltonian");
  document_.dissipation = optional_formula(root, "dissipation");
}

Limits DocumentReader::limits(const toml::table& table) const {
  return {number(table, "min"), number(table, "max"), number(table, "above"), number(table, "below")};
}

void DocumentReader::read_parameters(const toml::table& root, const char* key, bool sizes) {
  for (const Item& item : items(root, key)) {
    require_new_name(item.key, item.place);
    SceneDocument::Parameter parameter;
    parameter.name = item.key;
    parameter.size = sizes;
    parameter.place = item.place;
    const toml::node* value = item.node;
    if (item.node->is_table()) {
      const toml::table& entry = *item.node->as_table();
      check_keys(entry, "'" + item.key + "'", {"value", "unit", "meaning", "min", "max", "above", "below"});
      value = entry.get("value");
      if (value == nullptr) fail(item.place, fmt::format("'{}' needs 'value'", item.key));
      parameter.unit = string(entry, "unit");
      parameter.meaning = string(entry, "meaning");
      parameter.limits = limits(entry);
    }
    parameter.array = value->is_array();
    if (parameter.array && sizes) fail(item.place, fmt::format("the size '{}' must be one number", item.key));
    if (parameter.array)
      for (const auto& element : *value->as_array()) parameter.values.push_back(number(element, item.key));
    else
      parameter.values.push_back(number(*value, item.key));
    for (const double one : parameter.values)
      if (!parameter.limits.allow(one) || (sizes && one != std::floor(one)))
        fail(place_of(value->source()), fmt::format("'{}' = {:g}; it must be {}{}", item.key, one,
                                                    sizes ? "a whole number " : "", parameter.limits.text()));
    document_.parameters.push_back(std::move(parameter));
  }
}

void DocumentReader::add_coordinate(SceneDocument::Coordinate coordinate) {
  require_new_name(coordinate.name, coordinate.place);
  for (const char* prefix : {"v_", "p_"})
    if (!names_.insert(prefix + coordinate.name).second)
      fail(coordinate.place,
           fmt::format("'{}{}' is the velocity or momentum of '{}' and cannot name anything else", prefix,
                       coordinate.name, coordinate.name));
  document_.coordinates.push_back(std::move(coordinate));
}

void DocumentReader::read_coordinates(const toml::table& root) {
  const std::vector<Item> stated = items(root, "coordinates");
  if (std::ranges::any_of(stated, [](const Item& item) { return !factor_of(item).empty(); }))
    return read_spaces(root, stated);
  for (const Item& item : stated) {
    const toml::table& entry = table(item, "x = { unit = \"m\", meaning = \"…\" }");
    check_keys(entry, "coordinate '" + item.key + "'", {"unit", "meaning", "for", "cyclic", "tolerance"});
    SceneDocument::Coordinate coordinate;
    coordinate.name = item.key;
    coordinate.place = item.place;
    coordinate.unit = string(entry, "unit");
    coordinate.meaning = string(entry, "meaning");
    coordinate.loops = optional_formula(entry, "for");
    coordinate.cyclic = flag(entry, "cyclic");
    coordinate.tolerance = number(entry, "tolerance").value_or(0.0);
    if (!(coordinate.tolerance >= 0.0 && std::isfinite(coordinate.tolerance)))
      fail(item.place, "the tolerance of '" + item.key + "' must be a finite number of 0 or more");
    if (coordinate.cyclic && !coordinate.loops) fail(item.place, "cyclic = true needs for = \"i = 1..N\"");
    add_coordinate(std::move(coordinate));
  }
}

void DocumentReader::read_bodies(const toml::table& root) {
  bodies_ = BodyReader(*this, document_.file, document_).read(root);
  for (const auto& [name, unit, meaning, source] : bodies_.expansion.coordinates)
    add_coordinate({name, unit, meaning, {}, false, bodies_.place(source)});
  document_.bodies = bodies_.drawn;
}

void DocumentReader::add_body_definitions() {
  if (bodies_.lagrangian) document_.lagrangian = bodies_.lagrangian;
  if (bodies_.dissipation) document_.dissipation = bodies_.dissipation;
  for (const auto& definition : bodies_.expansion.definitions) {
    require_new_name(definition.name, bodies_.place(definition.source));
    document_.definitions.emplace(definition.name, bodies_.formula(definition));
  }
}

void DocumentReader::add_body_rows() {
  for (const auto& row : bodies_.expansion.rows)
    add_row({row.name, bodies_.formula(row), {}, bodies_.place(row.source)});
  for (auto& entry : document_.force)
    if (const auto joined = bodies_.force.find(entry.key.text); joined != bodies_.force.end())
      entry.values = {joined->second};
  const auto entry_of = [&](const bodies::Expansion::Named& named) {
    return SceneDocument::Entry{{named.name, bodies_.place(named.source)}, {bodies_.formula(named)}, false};
  };
  for (const auto& force : bodies_.expansion.force) document_.force.push_back(entry_of(force));
  for (const auto& start : bodies_.expansion.start) document_.start.push_back(entry_of(start));
  if (document_.project && document_.guesses.empty()) return;  // all are guesses
  for (const std::string& guess : bodies_.expansion.guesses)
    document_.guesses.push_back({guess, bodies_.place(0)});
}

void DocumentReader::read_circuit(const toml::table& root) {
  for (SceneDocument::Coordinate& coordinate : CircuitReader(*this, document_).read(root))
    add_coordinate(std::move(coordinate));
}

void DocumentReader::read_rows(const toml::table& root) {
  for (const toml::table* row : tables(root, "rows")) {
    check_keys(*row, "[[rows]]", {"name", "equation", "for", "compliance", "on"});
    const Place place = place_of(row->source());
    const std::string name = string(*row, "name", fmt::format("row{}", document_.rows.size() + 1));
    if (!is_name(name)) fail(place, fmt::format("'{}' is no name for a row", name));
    add_row({name, required_formula(*row, "equation", "[[rows]]"), optional_formula(*row, "for"), place,
             optional_formula(*row, "compliance"), !row->contains("on") || flag(*row, "on")});
    if (!document_.rows.back().on && document_.rows.back().loops)
      fail(place, "a repeated row cannot be switched: on = false is for single ones");
    if (document_.rows.back().compliance) add_extension(document_.rows.back());
  }
}

void DocumentReader::add_row(SceneDocument::Row row) {
  if (!row_names_.insert(row.name).second) fail(row.place, fmt::format("two rows are named '{}'", row.name));
  document_.rows.push_back(std::move(row));
}

void DocumentReader::add_extension(const SceneDocument::Row& row) {
  add_coordinate({row.extension(), "", "extension of row " + row.name, row.loops, false, row.place});
  extensions_.push_back(row.extension());
}

void DocumentReader::guess_extensions() {
  if (document_.project) return;
  for (const std::string& name : extensions_)
    for (const std::string& guess : {name, "v_" + name})
      document_.guesses.push_back({guess, document_.rows.front().place});
}

void DocumentReader::read_start(const toml::table& root) {
  for (const Item& item : items(root, "start")) {
    require_no_state(item);
    if (item.key == "project")
      document_.project = flag(*root["start"].as_table(), "project");
    else if (item.key == "operating_point")
      read_operating_point(item, *root["start"].as_table());
    else if (item.key == "guess")
      read_guesses(item);
    else if (item.key == "t")
      document_.start_time = formula(*item.node, "t");
    else
      add_entries(document_.start, item);
  }
}

void DocumentReader::read_operating_point(const Item& item, const toml::table& start) {
  document_.operating_point = flag(start, "operating_point");
  if (document_.operating_point && document_.branches.empty())
    fail(item.place, "'operating_point' is that of a circuit, and there are no elements of one");
}

void DocumentReader::read_guesses(const Item& item) {
  const toml::array* list = item.node->as_array();
  const bool names = list != nullptr && !list->empty() &&
                     std::ranges::all_of(*list, [](const toml::node& node) { return node.is_string(); });
  if (!names) fail(item.place, "expected guess = [\"x\", \"v_y\", …], the values that may be moved");
  for (const toml::node& node : *list) document_.guesses.push_back(formula(node, "guess"));
}

void DocumentReader::read_span(const toml::table& root) {
  const toml::node* node = root.get("span");
  if (node == nullptr || !node->is_table())
    fail(place_of(root.source()), "a scene needs a table [span] with 'end' and 'step'");
  const toml::table& span = *node->as_table();
  check_keys(span, "[span]", {"end", "step", "study_end"});
  const auto end = number(span, "end"), step = number(span, "step");
  if (!end || !step) fail(place_of(span.source()), "[span] needs 'end' and 'step'");
  if (!(*step > 0.0)) fail(place_of(span.get("step")->source()), "'step': expected a number above 0");
  document_.t_end = *end;
  document_.step = *step;
  document_.study_end = number(span, "study_end").value_or(*end);
}

void DocumentReader::read_references(const toml::table& root) {
  for (const toml::table* table : tables(root, "reference")) {
    SceneDocument::Reference reference{required_string(*table, "kind", "[[reference]]"),
                                       string(*table, "how"),
                                       0.0,
                                       number(*table, "t"),
                                       {},
                                       {},
                                       place_of(table->source())};
    if (reference.kind != "exact" && reference.kind != "published" && reference.kind != "own")
      fail(place_of(table->get("kind")->source()), "'kind': expected \"exact\", \"published\" or \"own\"");
    reference.digits = number(*table, "digits").value_or(0.0);
    if (!(reference.digits > 0.0)) fail(reference.place, "[[reference]] needs 'digits', above 0");
    for (const Item& item : in_file_order(*table)) {
      if (item.key == "with")
        for (const Item& parameter : in_file_order(this->table(item, "with = { k = 1e4 }")))
          reference.with[parameter.key] = number(*parameter.node, parameter.key);
      else if (item.key != "kind" && item.key != "how" && item.key != "digits" && item.key != "t")
        add_entries(reference.entries, item);
    }
    if (reference.entries.empty()) fail(reference.place, "[[reference]] holds no value");
    document_.references.push_back(std::move(reference));
  }
}

void DocumentReader::read_invariants(const toml::table& root) {
  for (const Item& item : items(root, "invariants")) {
    if (!item.node->is_table()) {
      document_.invariants.push_back({item.key, formula(*item.node, item.key), {}});
      continue;
    }
    const toml::table& entry = *item.node->as_table();
    check_keys(entry, "invariant '" + item.key + "'", {"formula", "value"});
    document_.invariants.push_back({item.key,
                                    required_formula(entry, "formula", "invariant '" + item.key + "'"),
                                    number(entry, "value")});
  }
}

void DocumentReader::read_recommended(const toml::table& root) {
  const toml::node* node = root.get("recommended");
  if (node == nullptr) return;
  if (!node->is_table()) fail(place_of(node->source()), "expected a table [recommended]");
  const toml::table& table = *node->as_table();
  check_keys(table, "[recommended]", {"method", "order", "step", "end", "tolerance"});
  SceneDocument::Recommended& recommended = document_.recommended;
  recommended.stated = true;
  recommended.method = string(table, "method", recommended.method);
  const double order = number(table, "order").value_or(0.0);
  recommended.step = number(table, "step").value_or(0.0);
  recommended.end = number(table, "end").value_or(0.0);
  recommended.tolerance = number(table, "tolerance").value_or(0.0);
  if (recommended.step < 0.0 || recommended.tolerance < 0.0 || !(order >= 0.0 && order <= 64.0))
    fail(place_of(table.source()),
         "[recommended]: expected an order in [1, 64], or 0 for the method's own, a step and a tolerance "
         "above 0");
  recommended.order = static_cast<int>(order);
}

}  // namespace diracstep::scene_compiler
