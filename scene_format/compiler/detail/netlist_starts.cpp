#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/compiler/detail/netlist_starts.hpp>
#include <set>

namespace diracstep::scene_compiler {

/// .ic V(a)=1 V(b)=2
void NetlistStarts::read(const Words& line) {
  for (std::size_t k = 1; k < line.size(); k += 4) {
    if (k + 3 >= line.size() || lower(line[k].text) != "v" || line[k + 2].text != "=")
      text_.fail(line[k].place, "expected V(node)=VALUE");
    if (!voltages_.emplace(text_.node(line[k + 1]), text_.value(line[k + 3])).second)
      text_.fail(line[k].place, "a second start of this node");
  }
}

void NetlistStarts::fill(SceneDocument& document) const {
  std::set<std::string> met;
  for (const auto& branch : document.branches) {
    if (branch.kind != "capacitor") continue;
    std::string voltage;
    Place place;
    for (const bool first : {true, false})
      if (const auto found = voltages_.find(first ? branch.from.name : branch.to.name);
          found != voltages_.end()) {
        voltage += fmt::format("{}({})", first ? "" : " - ", found->second.text);
        place = found->second.start;
        met.insert(found->first);
      }
    const std::string key = "q" + branch.name;
    const bool stated =
        std::ranges::any_of(document.start, [&](const auto& entry) { return entry.key.text == key; });
    if (!voltage.empty() && !stated)
      document.start.push_back(
          {{key, place},
           {{fmt::format("({})*({})", branch.values.find("value")->second.text, voltage), place}},
           false});
  }
  for (const auto& [name, value] : voltages_)
    if (!met.contains(name))
      text_.fail(value.start, fmt::format("no capacitor at node '{}' could hold its voltage", name));
}

}  // namespace diracstep::scene_compiler
