#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/names.hpp>
#include <diracstep/scene_format/fields/field_expansion.hpp>
#include <diracstep/scene_format/fields/field_grid.hpp>
#include <optional>

namespace diracstep::scene_compiler {

namespace {

constexpr std::size_t longest_text = 100'000;  // characters of a formula, as the parser of formulas takes

[[noreturn]] void fail(const toml::node& node, const std::string& message, std::size_t offset = 0) {
  throw FieldError{&node, message, offset};
}

/// A formula in quotes, or a plain number.
std::string formula(const toml::node& node, const std::string& what) {
  if (node.is_string()) return node.as_string()->get();
  if (node.is_integer() || node.is_floating_point())
    return fmt::format("{:.17g}", node.value<double>().value_or(0.0));
  fail(node, fmt::format("'{}': expected a formula in quotes or a number", what));
}

std::optional<std::string> optional_formula(const toml::table& table, const std::string& key) {
  const toml::node* node = table.get(key);
  return node == nullptr ? std::nullopt : std::optional(formula(*node, key));
}

std::string required_formula(const toml::table& table, const char* key) {
  if (!table.contains(key)) fail(table, fmt::format("[field] needs '{}'", key));
  return formula(*table.get(key), key);
}

void check_keys(const toml::table& table, const std::string& what, const std::vector<std::string>& known) {
  for (const auto& [key, node] : table)
    if (std::ranges::find(known, key.str()) == known.end())
      fail(node, fmt::format("unknown key '{}' in {}{}", key.str(), what,
                             did_you_mean(std::string(key.str()), known)));
}

/// The entries of a part of the scene in the order of the file; none where there is no such table.
std::vector<std::pair<std::string, const toml::node*>> entries_of(const toml::table& root, const char* part) {
  std::vector<std::pair<std::string, const toml::node*>> entries;
  const toml::node* node = root.get(part);
  if (node == nullptr) return entries;
  if (!node->is_table()) fail(*node, fmt::format("expected a table [{}]", part));
  for (const auto& [key, entry] : *node->as_table()) entries.emplace_back(key.str(), &entry);
  std::ranges::stable_sort(entries, [](const auto& a, const auto& b) {
    const auto &first = a.second->source().begin, &second = b.second->source().begin;
    return std::pair(first.line, first.column) < std::pair(second.line, second.column);
  });
  return entries;
}

class FieldExpansion {
 public:
  FieldExpansion(toml::table& root, const std::function<bool(std::string_view)>& is_reserved)
      : root_(root), is_reserved_(is_reserved) {}

  void expand() {
    if (!root_.get("field")->is_table()) fail(*root_.get("field"), "expected a table [field]");
    check_keys(stated(), "[field]",
               {"density", "cells", "from", "length", "space", "boundary", "left", "right", "jump"});
    read_grid();
    read_local_definitions();
    read_ends();
    require_known_names();
    require_regular();
    expand_coordinates();
    expand_lagrangian();
    expand_integrals(root_, "dissipation");
    for (const char* key : {"invariants", "outputs"}) expand_integrals_of_table(key);
    if (toml::table* start = root_["start"].as_table()) expand_entries(*start, false);
    if (toml::array* references = root_["reference"].as_array())
      for (toml::node& reference : *references)
        if (reference.is_table()) expand_entries(*reference.as_table(), true);
    add("sizes", "cells", cells());
    add("definitions", "dx", fmt::format("({})/cells", grid_.length));
    if (!root_.contains("recommended"))
      add("recommended", "method", "type1/gl:3");  // explicit ones have a limit
    root_.erase("field");
  }

 private:
  // The grid.

  std::string text_of(const toml::table& table, const char* key, const std::string& absent) const {
    return optional_formula(table, key).value_or(absent);
  }

  void read_grid() {
    try {
      grid_.element = field_element(text_of(stated(), "space", "gauss:1"));
    } catch (const Misuse& error) {
      fail(*stated().get("space"), std::string("'space' = ") + error.what());
    }
    grid_.from = text_of(stated(), "from", "0");
    grid_.length = required_formula(stated(), "length");
    if (const auto length = stated()["length"].value<double>(); length && !(*length > 0.0))
      fail(*stated().get("length"), "'length': expected a number above 0");
    grid_.periodic = stated().contains("boundary") && text_of(stated(), "boundary", "") == "periodic";
    for (const auto& [name, node] : entries_of(root_, "coordinates"))
      if (const auto* entry = node->as_table(); entry != nullptr && !entry->contains("for"))
        grid_.fields.push_back({name, {}, {}, {}});
    if (grid_.fields.empty()) fail(stated(), "[field] needs a field: a name in [coordinates] without 'for'");
  }

  void read_ends() {
    const char* unused = grid_.periodic ? "left" : "jump";
    for (const char* key : {unused, grid_.periodic ? "right" : unused})
      if (stated().contains(key))
        fail(*stated().get(key), fmt::format("'{}' has no meaning where the boundary is {}periodic", key,
                                             grid_.periodic ? "" : "not "));
    for (Field& field : grid_.fields) {
      field.jump = of_field("jump", field.name).value_or("");
      if (grid_.periodic) continue;
      field.left = field_end("left", field.name);
      field.right = field_end("right", field.name);
    }
  }

  /// A text for all fields or a table with one for each.
  std::optional<std::string> of_field(const char* key, const std::string& field) const {
    const toml::node* node = stated().get(key);
    if (node == nullptr) return std::nullopt;
    const toml::table* table = node->as_table();
    if (table == nullptr) return formula(*node, key);
    std::vector<std::string> names;
    for (const Field& one : grid_.fields) names.push_back(one.name);
    check_keys(*table, fmt::format("'{}'", key), names);
    return optional_formula(*table, field);
  }

  FieldEnd field_end(const char* key, const std::string& field) const {
    auto text = of_field(key, field);
    if (!text) text = of_field("boundary", field);
    if (!text)
      fail(stated(), fmt::format("[field] says nothing of '{}' at its {} end: expected "
                                 "'boundary' or '{}', \"periodic\", \"free\", \"fixed\", \"given\" or "
                                 "a formula in t",
                                 field, key, key));
    if (*text == "free") return {};
    if (*text == "periodic")
      fail(stated(), "\"periodic\" is for boundary = \"periodic\" alone, both ends and all fields");
    const bool right = std::string_view(key) == "right";
    if (*text == "fixed") return {true, value_of_start(field, right, true)};
    return {true, *text == "given" ? value_of_start(field, right, false) : *text};
  }

  /// The formula of the start at an end, at the time of the start or at all times.
  std::string value_of_start(const std::string& field, bool right, bool at_start) const {
    const toml::table* start = root_["start"].as_table();
    const auto text = start == nullptr ? std::nullopt : optional_formula(*start, field);
    if (!text) return "0";
    NameTexts place{{"x", grid_.end(right)}};
    if (at_start) place["t"] = '(' + text_of(*start, "t", "0") + ')';
    return with_definitions(*text, place);
  }

  // Names.

  bool varies_with_place(std::string_view name) const {
    if (name == "x" || local_.contains(name)) return true;
    return std::ranges::any_of(grid_.fields, [&](const Field& field) {
      return name == field.name || name == field.name + "_t" || name == field.name + "_x";
    });
  }

  /// Definitions that vary with the place are put in where they are used.
  void read_local_definitions() {
    const auto definitions = entries_of(root_, "definitions");
    for (std::size_t found = 1; found > 0;) {
      found = 0;
      for (const auto& [name, node] : definitions) {
        const std::string text = formula(*node, name);
        if (local_.contains(name) ||
            !mentions(text, [&](std::string_view other) { return varies_with_place(other); }))
          continue;
        local_.emplace(name, text);
        ++found;
      }
    }
    for (const auto& [name, text] : local_) root_["definitions"].as_table()->erase(name);
  }

  /// The text with local definitions in place of their names, and these texts for others.
  std::string with_definitions(const std::string& text, const NameTexts& others, int depth = 0) const {
    if (depth > 20 || text.size() > longest_text)
      fail(stated(), "the definitions of a field use themselves or are too long");
    NameTexts texts = others;
    for_each_name(text, [&](std::size_t, std::string_view name) {
      if (const auto found = local_.find(name); found != local_.end())
        texts[found->first] = '(' + with_definitions(found->second, others, depth + 1) + ')';
      return std::size_t{0};
    });
    return with_names_replaced(text, texts);
  }

  void require_known_names() const {
    const std::string density = required_formula(stated(), "density");
    std::vector<std::string> known{"x"};
    for (const Field& field : grid_.fields)
      for (const char* derivative : {"", "_t", "_x"}) known.push_back(field.name + derivative);
    for (const char* part : {"parameters", "definitions", "sizes", "inputs"})
      for (const auto& [name, node] : entries_of(root_, part)) known.push_back(name);
    for (const auto& [name, text] : local_) known.push_back(name);
    for_each_name(density, [&](std::size_t at, std::string_view name) {
      if (!is_reserved_(name) && std::ranges::find(known, name) == known.end())
        fail(*stated().get("density"),
             fmt::format("unknown name '{}' in the density{}", name, did_you_mean(std::string(name), known)),
             at);
      return std::size_t{0};
    });
  }

  // The scene.

  std::unique_ptr<toml::node> cells() const {
    const toml::node* node = stated().get("cells");
    if (node == nullptr) fail(stated(), "[field] needs 'cells'");
    if (const toml::table* table = node->as_table()) return std::make_unique<toml::table>(*table);
    const double value = node->value<double>().value_or(0.0);
    auto size = std::make_unique<toml::table>();
    size->insert("value", value);
    size->insert("min", 3);
    size->insert("meaning", "cells of the grid");
    if (!(value >= 3.0 && value == std::floor(value)))
      fail(*node, fmt::format("'cells' = {:g}: expected a whole number of at least 3", value));
    return size;
  }

  /// Between Gauss points a field can swing with no value at any of them: where such a swing fits into the
  /// grid the density does not see it, but in u_x.
  void require_regular() const {
    if (!grid_.element.gauss) return;
    const auto size = cells();
    const double cells = (*size->as_table())["value"].value_or(0.0);
    const int degree = grid_.element.degree;
    const bool swings_around = degree % 2 == 0 || std::fmod(cells, 2.0) == 0.0;
    const bool both_free = std::ranges::any_of(
        grid_.fields, [](const Field& field) { return !field.left.given && !field.right.given; });
    if (grid_.periodic ? !swings_around : !both_free) return;
    const std::string mend = grid_.periodic ? "an odd number of cells and an odd S" : "a value at one end";
    fail(stated(),
         fmt::format(
             "the motion is not determined: a field that is 0 at all Gauss points and not between them "
             "has no momentum; take {}, or space = \"lobatto:{}\"",
             mend, degree));
  }

  void expand_coordinates() {
    toml::table& coordinates = *root_["coordinates"].as_table();
    for (const Field& field : grid_.fields) {
      const toml::table entry = *coordinates.get(field.name)->as_table();
      for (const auto& family : grid_.families(field)) {
        if (family.name != field.name) coordinates.insert(family.name, entry);
        toml::table& one = *coordinates.get(family.name)->as_table();
        one.insert_or_assign("for", family.loops);
        if (grid_.periodic) one.insert_or_assign("cyclic", true);
      }
    }
  }

  std::string integral(const std::string& formula) const {
    return grid_.integral(with_definitions(formula, {}));
  }

  /// Formulas keep their places: texts are changed where they stand.
  void expand_lagrangian() {
    expand_integrals(root_, "lagrangian");
    const std::string sum = integral(required_formula(stated(), "density"));
    if (toml::node* stated = root_.get("lagrangian"); stated != nullptr && stated->is_string()) {
      *stated->as_string() = fmt::format("{} + {}", stated->as_string()->get(), sum);
      return;
    }
    toml::node& density = *root_["field"]["density"].node();
    if (!density.is_string()) fail(density, "'density': expected a formula in quotes");
    root_.insert_or_assign("lagrangian", std::move(*density.as_string()));
    *root_.get("lagrangian")->as_string() = sum;
  }

  void expand_integrals(toml::table& table, std::string_view key) const {
    toml::node* node = table.get(key);
    if (node == nullptr || !node->is_string()) return;
    toml::value<std::string>& text = *node->as_string();
    text = with_integrals_replaced(text.get(), [&](const std::string& inner) { return integral(inner); });
  }

  void expand_integrals_of_table(const char* key) {
    toml::table* table = root_[key].as_table();
    if (table == nullptr) return;
    for (auto&& [name, node] : *table) {
      if (node.is_table()) expand_integrals(*node.as_table(), "formula");
      expand_integrals(*table, name.str());
    }
  }

  /// Values of the start or of a reference, by x, at the places of the coordinates.
  void expand_entries(toml::table& entries, bool reference) const {
    for (const Field& field : grid_.fields) {
      const std::string velocity = field.name + "_t";
      const auto value = optional_formula(entries, field.name), rate = optional_formula(entries, velocity);
      for (const auto& family : grid_.families(field)) {
        const NameTexts place{{"x", family.position}};
        if (value) entries.insert_or_assign(family.name, with_definitions(*value, place));
        if (rate) entries.insert_or_assign("v_" + family.name, with_definitions(*rate, place));
        if (!rate && value && reference)
          entries.insert_or_assign("v_" + family.name,
                                   fmt::format("diff({}, t)", with_definitions(*value, place)));
      }
      entries.erase(velocity);
    }
  }

  void add(const char* part, const char* name, std::unique_ptr<toml::node> node) {
    toml::table& table = part_of_root(part, name);
    table.insert(name, std::move(*node->as_table()));
  }
  void add(const char* part, const char* name, const std::string& text) {
    part_of_root(part, name).insert(name, text);
  }
  toml::table& part_of_root(const char* part, const char* name) {
    if (!root_.contains(part)) root_.insert(part, toml::table{});
    toml::table* table = root_[part].as_table();
    if (table == nullptr || table->contains(name))
      fail(*root_.get(part), fmt::format("'{}' in [{}] is a name of the grid of [field]", name, part));
    return *table;
  }

  const toml::table& stated() const { return *root_.get("field")->as_table(); }

  toml::table& root_;
  const std::function<bool(std::string_view)>& is_reserved_;
  FieldGrid grid_;
  NameTexts local_;  ///< definitions that vary with the place
};

}  // namespace

void expand_field(toml::table& root, const std::function<bool(std::string_view)>& is_reserved) {
  FieldExpansion(root, is_reserved).expand();
}

}  // namespace diracstep::scene_compiler
