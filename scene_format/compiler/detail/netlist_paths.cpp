#include <fmt/format.h>

#include <diracstep/scene_format/compiler/detail/netlist_paths.hpp>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace diracstep::scene_compiler {

namespace {

/// Those that branches join to node 0; with `direct` along branches that a direct current flows through.
std::set<std::string> joined_to_ground(const SceneDocument& document, bool direct) {
  std::map<std::string, std::vector<std::string>> beside;
  for (const auto& branch : document.branches) {
    if (direct && (branch.kind == "capacitor" || branch.kind == "source_current")) continue;
    beside[branch.from.name].push_back(branch.to.name);
    beside[branch.to.name].push_back(branch.from.name);
  }
  std::set<std::string> reached{"0"};
  for (std::vector<std::string> open{"0"}; !open.empty();) {
    const std::string here = open.back();
    open.pop_back();
    for (const std::string& next : beside[here])
      if (reached.insert(next).second) open.push_back(next);
  }
  return reached;
}

}  // namespace

void note_floating_nodes(SceneDocument& document) {
  const std::set<std::string> joined = joined_to_ground(document, false),
                              direct = joined_to_ground(document, true);
  std::set<std::string> apart, blocked;
  for (const auto& branch : document.branches)
    for (const std::string& node : {branch.from.name, branch.to.name}) {
      if (!joined.contains(node))
        apart.insert(node);
      else if (!direct.contains(node))
        blocked.insert(node);
    }
  if (!apart.empty())
    document.notes.push_back(fmt::format(
        "floating: nothing joins the nodes {} to node 0; only voltages between them are determined",
        fmt::join(apart, ", ")));
  if (!blocked.empty())
    document.notes.push_back(fmt::format(
        "no path for a direct current from the nodes {} to node 0: what capacitors hold there at the "
        "start, 0 where nothing else is stated, stays",
        fmt::join(blocked, ", ")));
}

}  // namespace diracstep::scene_compiler
