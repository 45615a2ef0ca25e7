#include <fmt/format.h>

#include <algorithm>
#include <diracstep/core/numerics/near_names.hpp>
#include <diracstep/scene_format/compiler/control_reader.hpp>

namespace diracstep::scene_compiler {

namespace {

void require_control(const TableReader& tables, const std::string& name, Place place,
                     const std::vector<SceneDocument::Parameter>& parameters) {
  std::vector<std::string> known;
  for (const auto& parameter : parameters) {
    if (!parameter.array && !parameter.size) known.push_back(parameter.name);
  }
  if (std::ranges::find(known, name) == known.end())
    tables.fail(
        place, fmt::format("control '{}' is no parameter with one value{}", name, did_you_mean(name, known)));
}

}  // namespace

std::optional<SceneDocument::Control> read_control(const TableReader& tables, const toml::table& root,
                                                   const std::vector<SceneDocument::Parameter>& parameters) {
  const toml::node* const node = root.get("control");
  if (node == nullptr) return std::nullopt;
  const Item item{"control", place_of(node->source()), node};
  const toml::table& control = tables.table(item, "[control]");
  tables.check_keys(control, "[control]", {"parameters", "cost", "end_cost"});
  SceneDocument::Control result;
  result.place = item.place;
  result.cost = tables.optional_formula(control, "cost");
  result.end_cost = tables.optional_formula(control, "end_cost");
  if (!result.cost && !result.end_cost)
    tables.fail(item.place, "[control] has neither a 'cost' nor an 'end_cost'");
  const toml::array* const names = control["parameters"].as_array();
  if (names == nullptr || names->empty())
    tables.fail(item.place, "[control] names the parameters that are chosen: parameters = [\"u\"]");
  for (const toml::node& element : *names) {
    const auto name = element.value_exact<std::string>();
    const Place place = place_of(element.source());
    if (!name) tables.fail(place, "'parameters' of [control] are names in quotes");
    require_control(tables, *name, place, parameters);
    if (std::ranges::find(result.names, *name) != result.names.end())
      tables.fail(place, fmt::format("control '{}' is named twice", *name));
    result.names.push_back(*name);
  }
  return result;
}

}  // namespace diracstep::scene_compiler
