#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/csv_table.hpp>
#include <diracstep/scene_format/compiler/body_reader.hpp>
#include <diracstep/scene_format/compiler/circuit_reader.hpp>
#include <diracstep/scene_format/compiler/input_table.hpp>
#include <diracstep/scene_format/compiler/netlist_reader.hpp>
#include <diracstep/scene_format/compiler/scene_document.hpp>
#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <diracstep/scene_format/compiler/table_reader.hpp>
#include <diracstep/scene_format/fields/field_expansion.hpp>
#include <diracstep/scene_format/spaces/factor_texts.hpp>
#include <filesystem>
#include <initializer_list>
#include <set>

namespace diracstep::scene_compiler {

bool Limits::allow(double value) const {
  return std::isfinite(value) && (!min || value >= *min) && (!max || value <= *max) &&
         (!above || value > *above) && (!below || value < *below);
}

std::string Limits::text() const {
  const bool low = min || above, high = max || below;
  const double least = min ? *min : above.value_or(0.0), most = max ? *max : below.value_or(0.0);
  if (low && high) return fmt::format("in {}{:g}, {:g}{}", min ? '[' : '(', least, most, max ? ']' : ')');
  if (low) return fmt::format("{} {:g}", min ? "at least" : "above", least);
  if (high) return fmt::format("{} {:g}", max ? "at most" : "below", most);
  return "finite";
}

namespace {

class DocumentReader : TableReader {
 public:
  DocumentReader(const std::string& file, const std::string& text) : TableReader(file, text) {
    document_.file = file;
  }

  SceneDocument read(const toml::table& root) {
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
    guess_currents(document_);
    guess_extensions();
    require_no_spaces(root);
    return std::move(document_);
  }

 private:
  SceneDocument::Entry entry(const Item& item) const {
    SceneDocument::Entry entry{{item.key, item.place}, {}, item.node->is_array()};
    if (entry.array)
      for (const auto& element : *item.node->as_array()) entry.values.push_back(formula(element, item.key));
    else
      entry.values.push_back(formula(*item.node, item.key));
    return entry;
  }

  void require_new_name(const std::string& name, Place place) {
    if (!is_name(name))
      fail(place,
           fmt::format("'{}' is no name: expected a letter, then at most 63 letters, digits and _", name));
    if (is_reserved(name))
      fail(place, fmt::format("the name '{}' is taken by the format; choose another", name));
    if (!names_.insert(name).second) fail(place, fmt::format("the name '{}' is used twice", name));
  }

  void read_head(const toml::table& root) {
    document_.name = required_string(root, "name", "a scene");
    if (!is_name(document_.name))
      fail(place_of(root.get("name")->source()),
           fmt::format("name = \"{}\": expected letters, digits and _ only", document_.name));
    document_.kind = string(root, "class");
    document_.description = string(root, "description");
    document_.source = string(root, "source");
    document_.needs = string(root, "needs");
    const std::string redundant = string(root, "redundant", "refuse");
    if (redundant != "drop" && redundant != "refuse")
      fail(place_of(root.get("redundant")->source()), "'redundant': expected \"drop\" or \"refuse\"");
    document_.drop_redundant_rows = redundant == "drop";
    document_.lagrangian = optional_formula(root, "lagrangian");
    document_.hamiltonian = optional_formula(root, "hamiltonian");
    document_.dissipation = optional_formula(root, "dissipation");
  }

  Limits limits(const toml::table& table) const {
    return {number(table, "min"), number(table, "max"), number(table, "above"), number(table, "below")};
  }

  void read_parameters(const toml::table& root, const char* key, bool sizes) {
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
      if (parameter.array && sizes)
        fail(item.place, fmt::format("the size '{}' must be one number", item.key));
      if (parameter.array)
        for (const auto& element : *value->as_array()) parameter.values.push_back(number(element, item.key));
      else
        parameter.values.push_back(number(*value, item.key));
      for (const double one : parameter.values)
        if (!parameter.limits.allow(one) || (sizes && one != std::floor(one)))
          fail(place_of(value->source()),
               fmt::format("'{}' = {:g}; it must be {}{}", item.key, one, sizes ? "a whole number " : "",
                           parameter.limits.text()));
      document_.parameters.push_back(std::move(parameter));
    }
  }

  void add_coordinate(SceneDocument::Coordinate coordinate) {
    require_new_name(coordinate.name, coordinate.place);
    for (const char* prefix : {"v_", "p_"})
      if (!names_.insert(prefix + coordinate.name).second)
        fail(coordinate.place,
             fmt::format("'{}{}' is the velocity or momentum of '{}' and cannot name anything else", prefix,
                         coordinate.name, coordinate.name));
    document_.coordinates.push_back(std::move(coordinate));
  }

  void read_coordinates(const toml::table& root) {
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

  // Coordinates that are groups and spheres: scene_format/spaces.

  /// "SO3" of R = "SO3" and of R = { space = "SO3", … }.
  static std::string factor_of(const Item& item) {
    const toml::node* node = item.node->is_table() ? item.node->as_table()->get("space") : item.node;
    return node != nullptr && node->is_string() ? node->as_string()->get() : "";
  }

  void read_spaces(const toml::table& root, const std::vector<Item>& stated) {
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

  void add_flat_coordinate(const Item& item, const std::string& unit, const std::string& meaning) {
    add_coordinate({item.key, unit, meaning, {}, false, item.place});
    document_.spaces.kinds.emplace_back("R1");
    document_.spaces.components.push_back(item.key);
    document_.spaces.rates.push_back({"v_" + item.key, item.place});
  }

  void add_factor(const Item& item, const std::string& kind, const std::string& unit,
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
    for (const std::string& rate : texts.rates) all.rates.push_back({rate, item.place});
  }

  /// Entries of a start or a reference; "R = […]" and "w_R = […]" as those of its numbers.
  void add_entries(std::vector<SceneDocument::Entry>& entries, const Item& item) const {
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

  std::vector<FormulaText> formulas(const Item& item, std::size_t count) const {
    const toml::array* list = item.node->as_array();
    if (list == nullptr || list->size() != count)
      fail(item.place, fmt::format("'{}': expected a list of {} numbers or formulas", item.key, count));
    std::vector<FormulaText> values;
    for (const toml::node& node : *list) values.push_back(formula(node, item.key));
    return values;
  }

  /// Where a group or a sphere starts, in stored numbers.
  std::vector<FormulaText> place_on(const Item& item, const std::string& kind, std::size_t stored) const {
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

  /// By axis and angle or by matrix, and by position.
  std::vector<std::string> placed(const Item& item, const toml::table& table, const std::string& kind) const {
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

  std::vector<std::string> by_matrix(const Item& item, const toml::node& node) const {
    const std::string expected =
        fmt::format("'{}': expected matrix = [[…], […], […]], nine numbers", item.key);
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

  void require_no_spaces(const toml::table& root) const {
    if (document_.spaces.kinds.empty()) return;
    const char* const refused = "beside coordinates that are groups and spheres";
    if (!document_.branches.empty() || !bodies_.expansion.coordinates.empty() || !document_.bodies.empty())
      fail(place_of(root.source()), fmt::format("circuits and bodies do not stand {}", refused));
    if (document_.project || !document_.guesses.empty())
      fail(place_of(root.get("start")->source()),
           fmt::format("'guess' and 'project' do not stand {}; state a start on the rows", refused));
    for (const auto& row : document_.rows)
      if (row.compliance || row.loops)
        fail(row.place, fmt::format("repeated and compliant rows do not stand {}", refused));
  }

  // Bodies: their parts stand behind those of the file, as in the plain scene of plain_scene.hpp.

  void read_bodies(const toml::table& root) {
    bodies_ = BodyReader(*this, document_.file, document_).read(root);
    for (const auto& [name, unit, meaning, source] : bodies_.expansion.coordinates)
      add_coordinate({name, unit, meaning, {}, false, bodies_.place(source)});
    document_.bodies = bodies_.drawn;
  }

  void add_body_definitions() {
    if (bodies_.lagrangian) document_.lagrangian = bodies_.lagrangian;
    if (bodies_.dissipation) document_.dissipation = bodies_.dissipation;
    for (const auto& definition : bodies_.expansion.definitions) {
      require_new_name(definition.name, bodies_.place(definition.source));
      document_.definitions.emplace(definition.name, bodies_.formula(definition));
    }
  }

  /// And the force and the start.
  void add_body_rows() {
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

  void read_circuit(const toml::table& root) {
    for (SceneDocument::Coordinate& coordinate : CircuitReader(*this, document_).read(root))
      add_coordinate(std::move(coordinate));
  }

  std::vector<double> list(const toml::table& table, const char* key, const std::string& what,
                           Place place) const {
    const toml::node* node = table.get(key);
    if (node == nullptr || !node->is_array())
      fail(node == nullptr ? place : place_of(node->source()),
           fmt::format("{} needs '{}', a list of numbers", what, key));
    std::vector<double> values;
    for (const auto& element : *node->as_array()) values.push_back(number(element, key));
    return values;
  }

  void read_inputs(const toml::table& root) {
    constexpr std::size_t most_points = 1000;  // each becomes a part of the formulas
    for (const Item& item : items(root, "inputs")) {
      require_new_name(item.key, item.place);
      const std::string what = "input '" + item.key + "'";
      const toml::table& entry = table(item, "wind = { times = [0, 1, 2], values = [0, 3, 1] }");
      check_keys(entry, what, {"times", "values", "file", "column", "kind", "hold", "unit", "meaning"});
      SceneDocument::Input input{item.key, input_kind(entry), {}, {}, flag(entry, "hold"), item.place};
      const bool in_file = entry.contains("file");
      if (in_file == (entry.contains("times") || entry.contains("values")))
        fail(item.place, what + " needs 'times' and 'values', or a 'file'");
      if (in_file) {
        read_table_file(entry, what, input);
      } else {
        input.times = list(entry, "times", what, item.place);
        input.values = list(entry, "values", what, item.place);
      }
      if (input.times.size() != input.values.size() || input.times.size() < 2 ||
          input.times.size() > most_points)
        fail(item.place, fmt::format("{} has {} times and {} values; expected as many of both, from 2 to {}",
                                     what, input.times.size(), input.values.size(), most_points));
      for (std::size_t k = 1; k < input.times.size(); ++k)
        if (!(input.times[k] > input.times[k - 1]))
          fail(place_of((in_file ? *entry.get("file") : (*entry.get("times")->as_array())[k]).source()),
               fmt::format("{}: the time {:g} does not lie behind {:g}; expected them in ascending order",
                           what, input.times[k], input.times[k - 1]));
      document_.inputs.push_back(std::move(input));
    }
  }

  /// Times from the first column of a CSV file and values from the column named, or from the second.
  void read_table_file(const toml::table& entry, const std::string& what, SceneDocument::Input& input) const {
    const std::string name = required_string(entry, "file", what), column = string(entry, "column");
    const Place place = place_of(entry.get("file")->source());
    const std::filesystem::path path(name);
    if (path.is_absolute() || std::ranges::find(path, "..") != path.end())
      fail(place, what + ": 'file' is a path below the folder of the scene, without '..'");
    const std::string full = (std::filesystem::path(document_.file).parent_path() / path).string();
    try {
      const CsvTable table = read_csv(full, what, size_limits().file_bytes);
      const std::size_t second = column.empty() ? 1 : table.column(column);
      for (const auto& line : table.lines) {
        input.times.push_back(line.at(0));
        input.values.push_back(line.at(second));
      }
    } catch (const Misuse& misuse) {
      fail(place, misuse.what());
    }
  }

  SceneDocument::Input::Kind input_kind(const toml::table& entry) const {
    using Kind = SceneDocument::Input::Kind;
    const std::string kind = string(entry, "kind", "linear");
    if (kind != "linear" && kind != "cubic" && kind != "step")
      fail(place_of(entry.get("kind")->source()), "'kind': expected \"linear\", \"cubic\" or \"step\"");
    return kind == "linear" ? Kind::linear : kind == "cubic" ? Kind::cubic : Kind::step;
  }

  void read_states(const toml::table& root) {
    for (const Item& item : items(root, "states")) {
      const std::string what = "state '" + item.key + "'";
      const toml::table& entry = table(item, "e = { rate = \"th_wanted - th\", start = 0 }");
      check_keys(entry, what, {"rate", "start", "unit", "meaning"});
      document_.states.push_back(
          {item.key, optional_formula(entry, "rate").value_or(FormulaText{"0", item.place}), item.place});
      if (const auto start = optional_formula(entry, "start"))
        document_.start.push_back({{item.key, item.place}, {*start}, false});
      add_coordinate({item.key, string(entry, "unit"), string(entry, "meaning"), {}, false, item.place});
    }
  }

  void require_no_state(const Item& item) const {
    for (const auto& state : document_.states)
      if (item.key == state.name || item.key == "v_" + state.name || item.key == "p_" + state.name)
        fail(item.place,
             fmt::format("'{0}' belongs to the state '{1}': its start stands in [states], {1} = {{ rate "
                         "= …, start = … }}, and its velocity is its rate",
                         item.key, state.name));
  }

  void read_rows(const toml::table& root) {
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

  void add_row(SceneDocument::Row row) {
    if (!row_names_.insert(row.name).second)
      fail(row.place, fmt::format("two rows are named '{}'", row.name));
    document_.rows.push_back(std::move(row));
  }

  /// The coordinate of a compliant row, whose start follows from the others'.
  void add_extension(const SceneDocument::Row& row) {
    add_coordinate({row.extension(), "", "extension of row " + row.name, row.loops, false, row.place});
    extensions_.push_back(row.extension());
  }

  void guess_extensions() {
    if (document_.project) return;
    for (const std::string& name : extensions_)
      for (const std::string& guess : {name, "v_" + name})
        document_.guesses.push_back({guess, document_.rows.front().place});
  }

  void read_start(const toml::table& root) {
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

  void read_operating_point(const Item& item, const toml::table& start) {
    document_.operating_point = flag(start, "operating_point");
    if (document_.operating_point && document_.branches.empty())
      fail(item.place, "'operating_point' is that of a circuit, and there are no elements of one");
  }

  void read_guesses(const Item& item) {
    const toml::array* list = item.node->as_array();
    const bool names = list != nullptr && !list->empty() &&
                       std::ranges::all_of(*list, [](const toml::node& node) { return node.is_string(); });
    if (!names) fail(item.place, "expected guess = [\"x\", \"v_y\", …], the values that may be moved");
    for (const toml::node& node : *list) document_.guesses.push_back(formula(node, "guess"));
  }

  void read_span(const toml::table& root) {
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

  void read_references(const toml::table& root) {
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

  void read_invariants(const toml::table& root) {
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

  /// Columns beside t, the coordinates, v_…, p_…, lambda_…, energy and invariant_…, whose names they cannot
  /// have.
  void read_outputs(const toml::table& root) {
    for (const Item& item : items(root, "outputs"))
      add_output(item.key, formula(*item.node, item.key), item.place);
  }

  void add_output(const std::string& name, const FormulaText& formula, std::optional<Place> stated = {}) {
    const Place place = stated.value_or(formula.start);
    require_new_name(name, place);
    for (const char* taken : {"v_", "p_", "lambda_", "invariant_"})
      if (name.starts_with(taken))
        fail(place, fmt::format("'{}': columns that begin with {} are those of the scene itself; choose "
                                "another name",
                                name, taken));
    if (name == "energy") fail(place, "the column 'energy' is that of the scene itself");
    document_.outputs.push_back({name, formula, place});
  }

  void read_events(const toml::table& root) {
    std::set<std::string> names;
    for (const toml::table* event : tables(root, "events")) {
      check_keys(*event, "[[events]]",
                 {"name", "when", "every", "direction", "action", "if", "set", "restitution", "on", "off"});
      const Place place = place_of(event->source());
      const std::string name = required_string(*event, "name", "[[events]]");
      if (!is_name(name)) fail(place, fmt::format("'{}' is no name for an event", name));
      if (!names.insert(name).second) fail(place, fmt::format("two events are named '{}'", name));
      const std::string action = string(*event, "action", "record");
      if (action != "record" && action != "stop")
        fail(place_of(event->get("action")->source()),
             "'action': expected \"record\" or \"stop\"; what an event changes stands under set, "
             "restitution, on and off");
      SceneDocument::Event stated;
      stated.name = name;
      stated.when = optional_formula(*event, "when");
      stated.stop = action == "stop";
      stated.every = number(*event, "every").value_or(0.0);
      stated.condition = condition(*event);
      stated.restitution = optional_formula(*event, "restitution");
      stated.on = row_names(*event, "on");
      stated.off = row_names(*event, "off");
      stated.place = place;
      if (event->contains("set"))
        for (const Item& item : items(*event, "set")) stated.set.push_back(entry(item));
      stated.direction = direction(*event, stated.restitution.has_value());
      require_moment(*event, stated);
      document_.events.push_back(std::move(stated));
    }
  }

  /// A contact is approached from one side: from above 0 where nothing is said.
  SceneDocument::Event::Direction direction(const toml::table& event, bool contact) const {
    using Direction = SceneDocument::Event::Direction;
    const std::string direction = string(event, "direction", contact ? "falling" : "both");
    if (direction != "rising" && direction != "falling" && (contact || direction != "both"))
      fail(place_of(event.get("direction")->source()),
           contact ? "'direction' of an impact: expected \"falling\" or \"rising\", from the free side"
                   : "'direction': expected \"rising\", \"falling\" or \"both\"");
    return direction == "both"     ? Direction::both
           : direction == "rising" ? Direction::rising
                                   : Direction::falling;
  }

  void require_moment(const toml::table& event, const SceneDocument::Event& stated) const {
    if (stated.when.has_value() == event.contains("every"))
      fail(stated.place,
           "[[events]] needs one of 'when', a formula that changes its sign, and 'every', a time");
    if (stated.when) return;
    if (!(stated.every > 0.0 && std::isfinite(stated.every)))
      fail(place_of(event.get("every")->source()), "'every': expected a time above 0");
    if (event.contains("direction") || stated.restitution)
      fail(stated.place, "an event with 'every' has neither a direction nor a restitution");
  }

  /// "a > b and c < d" as a formula above 0 where it holds.
  std::optional<FormulaText> condition(const toml::table& event) const {
    auto text = optional_formula(event, "if");
    if (!text) return text;
    const std::string before = "if(";
    text->text = before + text->text + ", 1, 0)";
    text->start.column -= static_cast<decltype(text->start.column)>(before.size());
    return text;
  }

  /// A list of names of rows, or one.
  std::vector<std::string> row_names(const toml::table& event, const char* key) const {
    const toml::node* node = event.get(key);
    std::vector<std::string> names;
    if (node == nullptr) return names;
    const auto add = [&](const toml::node& one) {
      if (!one.is_string()) fail(place_of(one.source()), fmt::format("'{}': expected names of rows", key));
      names.push_back(one.as_string()->get());
      const auto found = std::ranges::find(document_.rows, names.back(), &SceneDocument::Row::name);
      if (found == document_.rows.end())
        fail(place_of(one.source()), fmt::format("'{}': there is no row '{}'", key, names.back()));
      if (found->loops)
        fail(place_of(one.source()),
             fmt::format("'{}': the row '{}' is repeated; rows that are switched are single ones", key,
                         names.back()));
    };
    if (const toml::array* list = node->as_array())
      for (const toml::node& one : *list) add(one);
    else
      add(*node);
    return names;
  }

  void read_recommended(const toml::table& root) {
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

  SceneDocument document_;
  BodyParts bodies_;
  std::set<std::string> names_, row_names_;
  std::vector<std::string> extensions_;
};

/// The position after a quoted text that begins at `at`, or after three quotes and all up to the next three.
std::size_t after_quotes(const std::string& text, std::size_t at) {
  const char quote = text[at];
  const std::string three(3, quote);
  const bool long_text = text.compare(at, 3, three) == 0;
  std::size_t i = at + (long_text ? 3 : 1);
  for (; i < text.size(); ++i) {
    if (text[i] == '\\' && quote == '"') {
      ++i;
    } else if (long_text ? text.compare(i, 3, three) == 0 : text[i] == quote) {
      return i + (long_text ? 3 : 1);
    } else if (!long_text && text[i] == '\n') {
      return i;  // an error, which the reader of TOML will tell
    }
  }
  return text.size();
}

/// The line of a key a.b.c… of more than `most` parts, 0 where there is none: the reader of TOML follows
/// these keys by recursion, as deep as they are long.
int line_of_long_key(const std::string& text, std::size_t most) {
  std::size_t dots = 0;
  for (std::size_t i = 0; i < text.size();) {
    const char c = text[i];
    if (c == '"' || c == '\'') {
      i = after_quotes(text, i);
      continue;
    }
    if (c == '#') i = std::min(text.find('\n', i), text.size());
    if (c == '.' && ++dots >= most)
      return static_cast<int>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(i), '\n')) +
             1;
    if (c == '=' || c == ',' || c == '[' || c == ']' || c == '{' || c == '}' || c == '\n' || c == '#')
      dots = 0;
    if (i < text.size()) ++i;
  }
  return 0;
}

}  // namespace

SceneDocument read_document(const std::string& file, const std::string& text) {
  const SizeLimits limits = size_limits();
  if (text.size() > limits.file_bytes)
    throw SceneError(file, {}, fmt::format("{} bytes; the limit is {}", text.size(), limits.file_bytes));
  if (const int line = line_of_long_key(text, limits.key_parts); line > 0)
    throw SceneError(file, {line, 1},
                     fmt::format("nested too deep: a key of more than {} parts", limits.key_parts));
  if (file.ends_with(".cir")) {
    SceneDocument document = read_netlist(file, text);
    guess_currents(document);
    return document;
  }
  toml::table root;
  try {
    root = toml::parse(std::string_view(text), std::string_view(file));
    if (root.contains("field")) expand_field(root, is_reserved);
    return DocumentReader(file, text).read(root);
  } catch (const toml::parse_error& error) {
    throw SceneError(file, place_of(error.source()), std::string(error.description()));
  } catch (const FieldError& error) {
    const TableReader reader(file, text);
    throw SceneError(file,
                     error.node->is_string() ? reader.formula(*error.node, "").place(error.offset)
                                             : place_of(error.node->source()),
                     error.message);
  }
}

}  // namespace diracstep::scene_compiler
