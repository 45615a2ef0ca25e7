#include <fmt/format.h>

#include <algorithm>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/csv_table.hpp>
#include <diracstep/scene_format/compiler/detail/document_reader.hpp>
#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <filesystem>

namespace diracstep::scene_compiler {

std::vector<double> DocumentReader::list(const toml::table& table, const char* key, const std::string& what,
                                         Place place) const {
  const toml::node* node = table.get(key);
  if (node == nullptr || !node->is_array())
    fail(node == nullptr ? place : place_of(node->source()),
         fmt::format("{} needs '{}', a list of numbers", what, key));
  std::vector<double> values;
  for (const auto& element : *node->as_array()) values.push_back(number(element, key));
  return values;
}

void DocumentReader::read_inputs(const toml::table& root) {
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
             fmt::format("{}: the time {:g} does not lie behind {:g}; expected them in ascending order", what,
                         input.times[k], input.times[k - 1]));
    document_.inputs.push_back(std::move(input));
  }
}

void DocumentReader::read_table_file(const toml::table& entry, const std::string& what,
                                     SceneDocument::Input& input) const {
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

SceneDocument::Input::Kind DocumentReader::input_kind(const toml::table& entry) const {
  using Kind = SceneDocument::Input::Kind;
  const std::string kind = string(entry, "kind", "linear");
  if (kind != "linear" && kind != "cubic" && kind != "step")
    fail(place_of(entry.get("kind")->source()), "'kind': expected \"linear\", \"cubic\" or \"step\"");
  return kind == "linear" ? Kind::linear : kind == "cubic" ? Kind::cubic : Kind::step;
}

void DocumentReader::read_states(const toml::table& root) {
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

void DocumentReader::require_no_state(const Item& item) const {
  for (const auto& state : document_.states)
    if (item.key == state.name || item.key == "v_" + state.name || item.key == "p_" + state.name)
      fail(item.place,
           fmt::format("'{0}' belongs to the state '{1}': its start stands in [states], {1} = {{ rate "
                       "= …, start = … }}, and its velocity is its rate",
                       item.key, state.name));
}

void DocumentReader::read_outputs(const toml::table& root) {
  for (const Item& item : items(root, "outputs"))
    add_output(item.key, formula(*item.node, item.key), item.place);
}

void DocumentReader::add_output(const std::string& name, const FormulaText& formula,
                                std::optional<Place> stated) {
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

}  // namespace diracstep::scene_compiler
