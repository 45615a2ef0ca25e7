#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/body_reader.hpp>
#include <diracstep/scene_format/compiler/plain_scene.hpp>

namespace diracstep::scene_compiler {

namespace {

std::string quoted_text(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\')
      quoted += std::string("\\") + c;
    else if (c == '\n')
      quoted += "\\n";
    else if (code < 0x20 || code == 0x7f)
      quoted += fmt::format("\\u{:04X}", code);
    else
      quoted += c;
  }
  return quoted + '"';
}

std::string key_text(const std::string& key) { return is_name(key) ? key : quoted_text(key); }

class PlainScene : TableReader {
 public:
  PlainScene(const std::string& file, const std::string& text, const toml::table& root,
             const SceneDocument& document)
      : TableReader(file, text),
        root_(root),
        document_(document),
        parts_(BodyReader(*this, file, document).read(root)) {}

  std::string print() {
    print_head();
    const std::vector<std::string> first{"sizes", "parameters", "coordinates", "definitions",
                                         "rows",  "force",      "start"};
    for (const std::string& key : first) print_part(key);
    for (const Item& item : in_file_order(root_))
      if (std::ranges::find(first, item.key) == first.end() && item.key != "outputs" && is_part(*item.node))
        print_part(item.key);
    print_part("outputs");
    return text_;
  }

 private:
  static bool is_part(const toml::node& node) {
    const toml::array* list = node.as_array();
    return node.is_table() || (list != nullptr && !list->empty() && (*list)[0].is_table());
  }

  /// A value on one line.
  std::string value(const toml::node& node) const {
    std::string text;
    if (const toml::array* list = node.as_array()) {
      for (const toml::node& one : *list) text += (text.empty() ? "" : ", ") + value(one);
      return '[' + text + ']';
    }
    if (const toml::table* table = node.as_table()) {
      for (const Item& item : in_file_order(*table))
        text += fmt::format("{} {} = {}", text.empty() ? "" : ",", key_text(item.key), value(*item.node));
      return '{' + text + " }";
    }
    if (node.is_string()) return quoted_text(node.as_string()->get());
    if (node.is_boolean()) return node.as_boolean()->get() ? "true" : "false";
    if (node.is_integer()) return std::to_string(node.as_integer()->get());
    return fmt::format("{}", number(node, "a value"));
  }

  void line(const std::string& key, const std::string& text) { text_ += key_text(key) + " = " + text + '\n'; }

  void print_head() {
    for (const Item& item : in_file_order(root_))
      if (!is_part(*item.node) && std::ranges::find(body_tables(), item.key) == body_tables().end() &&
          item.key != "lagrangian" && item.key != "dissipation")
        line(item.key, value(*item.node));
    if (document_.lagrangian) line("lagrangian", quoted_text(document_.lagrangian->text));
    if (document_.dissipation) line("dissipation", quoted_text(document_.dissipation->text));
  }

  void print_part(const std::string& key) {
    if (std::ranges::find(body_tables(), key) != body_tables().end()) return;
    const toml::node* node = root_.get(key);
    if (node != nullptr && node->is_array()) {
      for (const toml::table* table : tables(root_, key.c_str())) {
        text_ += fmt::format("\n[[{}]]\n", key);
        for (const Item& item : in_file_order(*table)) line(item.key, value(*item.node));
      }
    }
    if (key == "rows") return print_rows();
    const bool added =
        (key == "coordinates" && !parts_.expansion.coordinates.empty()) ||
        (key == "start" && !(parts_.expansion.start.empty() && parts_.expansion.guesses.empty())) ||
        !named(key).empty();
    if (!(node != nullptr && node->is_table()) && !added) return;
    text_ += fmt::format("\n[{}]\n", key);
    for (const Item& item : items(root_, key.c_str())) print_own(key, item);
    if (key == "coordinates")
      for (const auto& [name, unit, meaning, source] : parts_.expansion.coordinates)
        line(name, fmt::format("{{ unit = {}, meaning = {} }}", quoted_text(unit), quoted_text(meaning)));
    for (const auto& one : named(key)) line(one.name, quoted_text(one.text));
    if (key == "start") print_guesses();
  }

  void print_rows() {
    for (const auto& row : parts_.expansion.rows)
      text_ += fmt::format("\n[[rows]]\nname = \"{}\"\nequation = {}\n", row.name, quoted_text(row.text));
  }

  void print_own(const std::string& key, const Item& item) {
    const auto joined = parts_.force.find(item.key);
    if (key == "force" && joined != parts_.force.end())
      line(item.key, quoted_text(joined->second.text));
    else if (key != "start" || item.key != "guess")
      line(item.key, value(*item.node));
  }

  void print_guesses() {
    std::string list;
    if (const toml::array* own = root_["start"]["guess"].as_array())
      for (const toml::node& one : *own) list += (list.empty() ? "" : ", ") + value(one);
    if (!document_.project || !list.empty())
      for (const std::string& guess : parts_.expansion.guesses)
        list += (list.empty() ? "" : ", ") + quoted_text(guess);
    if (!list.empty()) line("guess", '[' + list + ']');
  }

  const std::vector<bodies::Expansion::Named>& named(const std::string& key) const {
    static const std::vector<bodies::Expansion::Named> nothing;
    const bodies::Expansion& made = parts_.expansion;
    return key == "definitions" ? made.definitions
           : key == "force"     ? made.force
           : key == "start"     ? made.start
           : key == "outputs"   ? made.outputs
                                : nothing;
  }

  const toml::table& root_;
  const SceneDocument& document_;
  BodyParts parts_;
  std::string text_;
};

}  // namespace

std::string plain_scene(const std::string& file, const std::string& text) {
  if (file.ends_with(".cir")) throw SceneError(file, {}, "a netlist has no bodies to expand");
  const SceneDocument document = read_document(file, text);
  if (document.bodies.empty()) return text;
  const toml::table root = toml::parse(std::string_view(text), std::string_view(file));
  return PlainScene(file, text, root, document).print();
}

}  // namespace diracstep::scene_compiler
