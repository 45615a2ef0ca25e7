#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/csv_table.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <diracstep/scene_format/compiler/table_reader.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <diracstep/sweeps/random_numbers.hpp>
#include <diracstep/sweeps/sweep.hpp>
#include <filesystem>

namespace diracstep {

using namespace scene_compiler;

namespace {

constexpr double most_members = 1e12, most_values = 1e7;
constexpr std::size_t most_table_bytes = 1'000'000'000;

class SweepReader : TableReader {
 public:
  SweepReader(const std::string& path, const std::string& text) : TableReader(path, text), path_(path) {
    sweep_.file = path;
    sweep_.text = text;
  }

  Sweep read(const toml::table& root) {
    check_keys(root, "the sweep",
               {"scene", "method", "order", "rule", "step", "end", "error", "project", "checks", "block",
                "set", "grid", "table", "random", "sobol", "record"});
    read_run(root);
    for (const Item& item : items(root, "set")) {
      if (item.key.starts_with("start."))
        fail(item.place,
             fmt::format("'{}': [set] holds parameters; a start of one value belongs to [grid]", item.key));
      sweep_.set[item.key] = number(*item.node, item.key);
    }
    for (const Item& item : items(root, "grid")) sweep_.grid.push_back({item.key, axis(item)});
    read_table(root);
    read_draws(root);
    read_record(root);
    require_members(root);
    return std::move(sweep_);
  }

 private:
  std::string beside(const std::string& name) const {
    const std::filesystem::path path(name);
    return path.is_absolute() ? name : (std::filesystem::path(path_).parent_path() / path).string();
  }

  std::optional<double> positive(const toml::table& table, const char* key) const {
    const auto value = number(table, key);
    if (value && !(*value > 0.0))
      fail(place_of(table.get(key)->source()),
           fmt::format("{} = {:g}; expected a number above 0", key, *value));
    return value;
  }

  long whole(const toml::table& table, const char* key, double least, double most) const {
    const auto value = number(table, key);
    if (!value) return 0;
    if (*value != std::floor(*value) || *value < least || *value > most)
      fail(place_of(table.get(key)->source()),
           fmt::format("{} = {:g}; expected a whole number from {:g} to {:g}", key, *value, least, most));
    return static_cast<long>(*value);
  }

  void read_run(const toml::table& root) {
    const std::string scene = required_string(root, "scene", "a sweep");
    sweep_.scene = is_scene_file(scene) ? beside(scene) : scene;
    sweep_.method = string(root, "method", "auto");
    sweep_.order = static_cast<int>(whole(root, "order", 0, 40));
    if (root.contains("rule")) sweep_.rule = string(root, "rule");
    sweep_.step = positive(root, "step").value_or(0.0);
    sweep_.end = number(root, "end");
    sweep_.error = positive(root, "error");
    sweep_.project = flag(root, "project");
    sweep_.checks = !root.contains("checks") || flag(root, "checks");
    sweep_.block = whole(root, "block", 1, 1e9);
    if (sweep_.error && sweep_.step > 0.0)
      fail(place_of(root.get("step")->source()), "'error' finds the step itself; leave out one of the two");
  }

  /// A list, or from and to with a count.
  std::vector<double> axis(const Item& item) const {
    if (const toml::array* list = item.node->as_array()) {
      std::vector<double> values;
      for (const auto& element : *list) values.push_back(number(element, item.key));
      if (values.empty()) fail(item.place, fmt::format("'{}': the list is empty", item.key));
      return values;
    }
    if (!item.node->is_table()) return {number(*item.node, item.key)};
    const toml::table& range = *item.node->as_table();
    check_keys(range, "'" + item.key + "'", {"from", "to", "count", "spacing"});
    const auto from = number(range, "from"), to = number(range, "to");
    const std::string spacing = string(range, "spacing", "linear");
    if (!from || !to || !range.contains("count"))
      fail(item.place,
           fmt::format("'{}': expected a list of numbers, or {{ from = 1, to = 2, count = 11 }}", item.key));
    if (spacing != "linear" && spacing != "log")
      fail(place_of(range.get("spacing")->source()),
           fmt::format("spacing = '{}'; allowed are \"linear\" and \"log\"", spacing));
    if (spacing == "log" && !(*from * *to > 0.0))
      fail(item.place,
           fmt::format("'{}': spacing = \"log\" needs two ends of one sign that are not 0", item.key));
    return spaced(*from, *to, whole(range, "count", 1, most_values), spacing == "log");
  }

  static std::vector<double> spaced(double from, double to, long count, bool by_ratio) {
    std::vector<double> values{from};
    for (long k = 1; k < count; ++k) {
      const double part = static_cast<double>(k) / static_cast<double>(count - 1);
      values.push_back(k == count - 1 ? to
                       : by_ratio     ? from * std::pow(to / from, part)
                                      : from + (to - from) * part);
    }
    return values;
  }

  void read_table(const toml::table& root) {
    const toml::node* node = root.get("table");
    if (node == nullptr) return;
    if (!node->is_string())
      fail(place_of(node->source()), "'table': expected the name of a CSV file in quotes");
    const std::string file = beside(node->as_string()->get());
    CsvTable read = read_csv(file, "the table", most_table_bytes, 1);
    if (read.names.empty() || read.lines.empty())
      throw Misuse(fmt::format("'{}': expected a line of names and a line of numbers for each member", file));
    sweep_.table_names = std::move(read.names);
    sweep_.table = std::move(read.lines);
  }

  Drawn drawn(const Item& item) const {
    const toml::table& law = table(item, "{ uniform = [0.5, 2.0] }");
    check_keys(law, "'" + item.key + "'", {"uniform", "log_uniform", "normal"});
    if (law.size() != 1)
      fail(item.place, fmt::format("'{}': expected one of uniform, log_uniform and normal", item.key));
    const auto only = law.begin();
    const std::string name(only->first.str());
    const toml::node& node = only->second;
    const toml::array* pair = node.as_array();
    if (pair == nullptr || pair->size() != 2)
      fail(place_of(node.source()), fmt::format("'{}': expected two numbers, as in [0.5, 2.0]", name));
    Drawn found{item.key, Drawn::Law::uniform, number(*pair->get(0), item.key),
                number(*pair->get(1), item.key)};
    if (name == "normal") {
      found.law = Drawn::Law::normal;
      if (!(found.b >= 0.0)) fail(place_of(node.source()), "a standard deviation is not negative");
    } else if (name == "log_uniform") {
      found.law = Drawn::Law::log_uniform;
      if (!(found.a * found.b > 0.0))
        fail(place_of(node.source()), "log_uniform needs two ends of one sign that are not 0");
    }
    return found;
  }

  void read_draws(const toml::table& root) {
    if (root.contains("random") && root.contains("sobol"))
      fail(place_of(root.get("sobol")->source()), "a sweep has [random] or [sobol], not both");
    sweep_.sobol = root.contains("sobol");
    const char* key = sweep_.sobol ? "sobol" : "random";
    if (!root.contains(key)) return;
    if (!root.get(key)->is_table())
      fail(place_of(root.get(key)->source()), fmt::format("expected a table [{}]", key));
    const toml::table& draws = *root.get(key)->as_table();
    check_keys(draws, fmt::format("[{}]", key), {"count", "seed", "of"});
    if (!draws.contains("count") || !draws.contains("of"))
      fail(place_of(draws.source()), fmt::format("[{0}] needs 'count' and [{0}.of]", key));
    sweep_.draws = whole(draws, "count", 1, sweep_.sobol ? 4294967296.0 : most_members);
    sweep_.seed = static_cast<std::uint64_t>(whole(draws, "seed", 0, 9e15));
    for (const Item& item : items(draws, "of")) sweep_.drawn.push_back(drawn(item));
    if (sweep_.sobol && sweep_.drawn.size() > sobol_dimensions)
      fail(place_of(draws.source()),
           fmt::format("{} numbers in [sobol.of]; {} are the most, [random] has no limit",
                       sweep_.drawn.size(), sobol_dimensions));
  }

  std::vector<std::string> texts(const toml::table& table, const char* key) const {
    std::vector<std::string> all;
    const toml::node* node = table.get(key);
    if (node == nullptr) return all;
    const toml::array* list = node->as_array();
    if (list == nullptr)
      fail(place_of(node->source()), fmt::format("'{}': expected a list of names in quotes", key));
    for (const auto& element : *list) {
      if (!element.is_string())
        fail(place_of(element.source()), fmt::format("'{}': expected a name in quotes", key));
      if (std::ranges::find(all, element.as_string()->get()) != all.end())
        fail(place_of(element.source()), fmt::format("'{}' stands twice", element.as_string()->get()));
      all.push_back(element.as_string()->get());
    }
    return all;
  }

  void read_record(const toml::table& root) {
    const toml::node* node = root.get("record");
    if (node == nullptr) return;
    if (!node->is_table()) fail(place_of(node->source()), "expected a table [record]");
    const toml::table& record = *node->as_table();
    check_keys(record, "[record]", {"values", "extrema", "events", "derivatives"});
    sweep_.values = texts(record, "values");
    sweep_.extrema = texts(record, "extrema");
    sweep_.events = texts(record, "events");
    sweep_.derivatives = texts(record, "derivatives");
  }

  void require_members(const toml::table& root) const {
    std::vector<std::string> varied = sweep_.names();
    if (varied.empty())
      fail(place_of(root.source()), "nothing varies: a sweep needs [grid], table, [random] or [sobol]");
    for (const auto& [name, value] : sweep_.set) varied.push_back(name);
    std::ranges::sort(varied);
    if (const auto twice = std::ranges::adjacent_find(varied); twice != varied.end())
      fail(place_of(root.source()), fmt::format("'{}' is given twice", *twice));
    double count = static_cast<double>(sweep_.draws);
    if (!sweep_.table.empty()) count *= static_cast<double>(sweep_.table.size());
    for (const Sweep::Axis& axis : sweep_.grid) count *= static_cast<double>(axis.values.size());
    if (count > most_members)
      fail(place_of(root.source()), fmt::format("{:g} members; {:g} are the most", count, most_members));
  }

  const std::string& path_;
  Sweep sweep_;
};

}  // namespace

Sweep read_sweep(const std::string& path) {
  const std::string text = read_file(path, "the sweep", size_limits().file_bytes);
  toml::table root;
  try {
    root = toml::parse(text, path);
  } catch (const toml::parse_error& error) {
    throw SceneError(path, place_of(error.source()), std::string(error.description()));
  }
  return SweepReader(path, text).read(root);
}

}  // namespace diracstep
