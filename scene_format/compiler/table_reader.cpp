#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/compiler/table_reader.hpp>

namespace diracstep::scene_compiler {

Place place_of(const toml::source_region& region) {
  return {static_cast<int>(region.begin.line), static_cast<int>(region.begin.column)};
}

TableReader::TableReader(const std::string& file, const std::string& text) : file_(file), text_(text) {
  line_starts_.push_back(0);
  for (std::size_t i = 0; i < text.size(); ++i)
    if (text[i] == '\n') line_starts_.push_back(i + 1);
}

void TableReader::fail(Place place, const std::string& message) const {
  throw SceneError(file_, place, message);
}

void TableReader::check_keys(const toml::table& table, const std::string& what,
                             const std::vector<std::string>& known) const {
  for (const auto& [key, node] : table)
    if (std::ranges::find(known, key.str()) == known.end())
      fail(place_of(key.source()),
           fmt::format("unknown key '{}' in {}{}", key.str(), what, suggestion(key.str(), known)));
}

std::vector<Item> TableReader::in_file_order(const toml::table& table) const {
  std::vector<Item> items;
  for (const auto& [key, node] : table)
    items.push_back({std::string(key.str()), place_of(key.source()), &node});
  std::ranges::sort(items, [](const Item& a, const Item& b) {
    return std::pair(a.place.line, a.place.column) < std::pair(b.place.line, b.place.column);
  });
  return items;
}

std::vector<Item> TableReader::items(const toml::table& root, const char* key) const {
  const toml::node* node = root.get(key);
  if (node == nullptr) return {};
  if (!node->is_table()) fail(place_of(node->source()), fmt::format("expected a table [{}]", key));
  return in_file_order(*node->as_table());
}

std::vector<const toml::table*> TableReader::tables(const toml::table& root, const char* key) const {
  std::vector<const toml::table*> all;
  const toml::node* node = root.get(key);
  if (node == nullptr) return all;
  if (!node->is_array())
    fail(place_of(node->source()), fmt::format("expected [[{}]], with two brackets", key));
  for (const auto& element : *node->as_array()) {
    if (!element.is_table()) fail(place_of(element.source()), fmt::format("expected a table [[{}]]", key));
    all.push_back(element.as_table());
  }
  return all;
}

const toml::table& TableReader::table(const Item& item, const char* example) const {
  if (!item.node->is_table())
    fail(place_of(item.node->source()), fmt::format("'{}': expected a table such as {}", item.key, example));
  return *item.node->as_table();
}

std::string TableReader::string(const toml::table& table, const char* key, const std::string& absent) const {
  const toml::node* node = table.get(key);
  if (node == nullptr) return absent;
  if (!node->is_string()) fail(place_of(node->source()), fmt::format("'{}': expected a text in quotes", key));
  return node->as_string()->get();
}

std::string TableReader::required_string(const toml::table& table, const char* key,
                                         const std::string& what) const {
  if (!table.contains(key)) fail(place_of(table.source()), fmt::format("{} needs '{}'", what, key));
  return string(table, key);
}

double TableReader::number(const toml::node& node, const std::string& what) const {
  const auto value = node.value<double>();
  if (!(node.is_integer() || node.is_floating_point()) || !value || !std::isfinite(*value))
    fail(place_of(node.source()),
         fmt::format("'{}': expected a finite number{}", what,
                     node.is_string() ? "; a formula belongs in [definitions]" : ""));
  return *value;
}

std::optional<double> TableReader::number(const toml::table& table, const char* key) const {
  const toml::node* node = table.get(key);
  return node == nullptr ? std::nullopt : std::optional(number(*node, key));
}

bool TableReader::flag(const toml::table& table, const char* key) const {
  const toml::node* node = table.get(key);
  if (node == nullptr) return false;
  if (!node->is_boolean()) fail(place_of(node->source()), fmt::format("'{}': expected true or false", key));
  return node->as_boolean()->get();
}

Place TableReader::inside_quotes(Place place) const {
  if (place.line < 1 || static_cast<std::size_t>(place.line) > line_starts_.size()) return place;
  std::size_t at = line_starts_[static_cast<std::size_t>(place.line) - 1];
  for (int column = 1; column < place.column && at < text_.size(); ++column) do
      ++at;
    while (at < text_.size() && (static_cast<unsigned char>(text_[at]) & 0xC0u) == 0x80u);
  const std::string_view rest = std::string_view(text_).substr(std::min(at, text_.size()));
  if (rest.starts_with("'''") || rest.starts_with("\"\"\"")) {
    if (rest.size() > 3 && (rest[3] == '\n' || rest.substr(3, 2) == "\r\n")) return {place.line + 1, 1};
    return {place.line, place.column + 3};
  }
  return {place.line, place.column + 1};
}

FormulaText TableReader::formula(const toml::node& node, const std::string& what) const {
  const Place place = place_of(node.source());
  if (node.is_string()) return {node.as_string()->get(), inside_quotes(place)};
  if (node.is_integer() || node.is_floating_point())
    return {fmt::format("{:.17g}", number(node, what)), place};
  fail(place, fmt::format("'{}': expected a formula in quotes or a number", what));
}

std::optional<FormulaText> TableReader::optional_formula(const toml::table& table, const char* key) const {
  const toml::node* node = table.get(key);
  return node == nullptr ? std::nullopt : std::optional(formula(*node, key));
}

FormulaText TableReader::required_formula(const toml::table& table, const char* key,
                                          const std::string& what) const {
  const toml::node* node = table.get(key);
  if (node == nullptr) fail(place_of(table.source()), fmt::format("{} needs '{}'", what, key));
  return formula(*node, key);
}

}  // namespace diracstep::scene_compiler
