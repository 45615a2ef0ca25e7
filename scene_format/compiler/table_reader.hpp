#pragma once

#include <toml++/toml.h>

#include <diracstep/scene_format/compiler/formula_scanner.hpp>
#include <optional>
#include <string>
#include <vector>

namespace diracstep::scene_compiler {

Place place_of(const toml::source_region& region);

/// A table or value of a scene file, by name.
struct Item {
  std::string key;
  Place place;
  const toml::node* node;
};

/// Reads values of given types from TOML; a value of another type throws SceneError with its place.  The
/// file's name and text must outlive it.
class TableReader {
 public:
  TableReader(const std::string& file, const std::string& text);

  [[noreturn]] void fail(Place place, const std::string& message) const;
  void check_keys(const toml::table& table, const std::string& what,
                  const std::vector<std::string>& known) const;

  /// The entries of a table in the order of the file; of the table `key`, none where there is no such table.
  std::vector<Item> in_file_order(const toml::table& table) const;
  std::vector<Item> items(const toml::table& root, const char* key) const;
  /// The tables [[key]].
  std::vector<const toml::table*> tables(const toml::table& root, const char* key) const;
  const toml::table& table(const Item& item, const char* example) const;

  std::string string(const toml::table& table, const char* key, const std::string& absent = "") const;
  std::string required_string(const toml::table& table, const char* key, const std::string& what) const;
  double number(const toml::node& node, const std::string& what) const;
  std::optional<double> number(const toml::table& table, const char* key) const;
  bool flag(const toml::table& table, const char* key) const;

  /// A formula in quotes, or a plain number.
  FormulaText formula(const toml::node& node, const std::string& what) const;
  std::optional<FormulaText> optional_formula(const toml::table& table, const char* key) const;
  FormulaText required_formula(const toml::table& table, const char* key, const std::string& what) const;

 private:
  /// Where the characters of a quoted text begin.
  Place inside_quotes(Place place) const;

  const std::string& file_;
  const std::string& text_;
  std::vector<std::size_t> line_starts_;
};

}  // namespace diracstep::scene_compiler
