#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/compiler/detail/document_reader.hpp>
#include <set>

namespace diracstep::scene_compiler {

void DocumentReader::read_events(const toml::table& root) {
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
    for (const std::string& row : stated.on)
      if (std::ranges::find(stated.off, row) != stated.off.end())
        fail(place_of(event->get("off")->source()),
             fmt::format("the row '{}' is switched on and off by the same event", row));
    stated.place = place;
    if (event->contains("set"))
      for (const Item& item : items(*event, "set")) stated.set.push_back(entry(item));
    stated.direction = direction(*event, stated.restitution.has_value());
    require_moment(*event, stated);
    document_.events.push_back(std::move(stated));
  }
}

SceneDocument::Event::Direction DocumentReader::direction(const toml::table& event, bool contact) const {
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

void DocumentReader::require_moment(const toml::table& event, const SceneDocument::Event& stated) const {
  if (stated.when.has_value() == event.contains("every"))
    fail(stated.place,
         "[[events]] needs one of 'when', a formula that changes its sign, and 'every', a time");
  if (stated.when) return;
  if (!(stated.every > 0.0 && std::isfinite(stated.every)))
    fail(place_of(event.get("every")->source()), "'every': expected a time above 0");
  if (event.contains("direction") || stated.restitution)
    fail(stated.place, "an event with 'every' has neither a direction nor a restitution");
}

std::optional<FormulaText> DocumentReader::condition(const toml::table& event) const {
  auto text = optional_formula(event, "if");
  if (!text) return text;
  const std::string before = "if(";
  text->text = before + text->text + ", 1, 0)";
  text->start.column -= static_cast<decltype(text->start.column)>(before.size());
  return text;
}

std::vector<std::string> DocumentReader::row_names(const toml::table& event, const char* key) const {
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

}  // namespace diracstep::scene_compiler
