#include <algorithm>
#include <diracstep/scene_format/compiler/detail/formula_reader.hpp>
#include <ranges>
#include <span>

namespace diracstep::scene_compiler {

namespace {

constexpr std::array<std::string_view, 13> keys{"t",    "pi",     "kind", "digits", "how",
                                                "with", "source", "name", "method", "project",
                                                "for",  "each",   "guess"};

}  // namespace

bool is_reserved(std::string_view name) {
  const auto is = [&](std::string_view other) { return other == name; };
  return std::ranges::any_of(keys, is) || std::ranges::any_of(forms, is) ||
         std::ranges::any_of(functions, is, &Function::name);
}

std::string Symbols::velocity_text(int family) const {
  const auto number = static_cast<std::size_t>(family);
  if (components.empty()) return "v_" + families[number].name;
  const auto component =
      std::ranges::find(components, family, [](const auto& entry) { return entry.second; });
  std::string name = "v_" + component->first;
  for (const auto& [entry, text] : entries)
    if (entry.starts_with("w_") && text.text == name)
      return entry + " (" + name + ", in the body frame of " + entry.substr(2, entry.find('[') - 2) + ")";
  return name;
}

std::string Symbols::velocity_meant(std::string_view name) const {
  if (!name.starts_with("v_")) return {};
  for (const auto& [velocity, indices] : indexed) {
    if (!velocity.starts_with("w_")) continue;
    const std::string_view group = std::string_view(velocity).substr(2), rest = name.substr(2);
    if (rest != group && !(rest.starts_with(group) && rest[group.size()] == '_')) continue;
    std::string list;
    for (const auto& [entry, text] : entries)
      if (entry.starts_with(velocity + '[')) list += (list.empty() ? "" : ", ") + entry;
    return "; the velocity of " + std::string(group) + ", in its body frame, is " + list;
  }
  return {};
}

Node FormulaParser::formula(const FormulaText& text, const Context& context) {
  return Reader(*this, text, context).whole_formula();
}

Node FormulaParser::equation(const FormulaText& text, const Context& context) {
  return Reader(*this, text, context).whole_equation();
}

std::vector<int> FormulaParser::loops(const FormulaText& text, const Context& context) {
  return Reader(*this, text, context).whole_loops();
}

Node FormulaParser::index(const FormulaText& text, const Context& context) {
  return Reader(*this, text, context).whole_index();
}

Node FormulaParser::coordinate(const FormulaText& text, const Context& context) {
  return Reader(*this, text, context).whole_coordinate();
}

Node FormulaParser::rate(Node f) {
  Node rate = graph_.derivative(f, graph_.time());
  for (const Node node : graph_.reachable(std::span(&f, 1))) {
    const NodeData leaf = graph_[node];
    if (leaf.op != Op::coordinate || leaf.c != static_cast<int>(Role::position)) continue;
    const Node velocity = symbols_.rates.empty()
                              ? graph_.coordinate(leaf.a, leaf.b, Role::second)
                              : formula(symbols_.rates[static_cast<std::size_t>(leaf.a)],
                                        {.what = "a rate", .positions = true, .second = 'v'});
    rate = graph_.add(rate, graph_.multiply(graph_.derivative(f, node), velocity));
  }
  return rate;
}

}  // namespace diracstep::scene_compiler
