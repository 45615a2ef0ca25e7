#include <fmt/format.h>

#include <algorithm>
#include <diracstep/core/numerics/names.hpp>
#include <diracstep/scene_format/compiler/input_table.hpp>

namespace diracstep::scene_compiler {

namespace {

/// Second derivatives of the natural cubic spline at its points, by elimination of the tridiagonal system
///   h_{k−1} m_{k−1} + 2 (h_{k−1} + h_k) m_k + h_k m_{k+1} = 6 (s_k − s_{k−1}),   s the slopes of the chords.
std::vector<double> bends(const std::vector<double>& x, const std::vector<double>& y) {
  const std::size_t n = x.size();
  std::vector<double> bend(n, 0.0), above(n, 0.0);
  const auto width = [&](std::size_t k) { return x[k + 1] - x[k]; };
  const auto slope = [&](std::size_t k) { return (y[k + 1] - y[k]) / width(k); };
  for (std::size_t k = 1; k + 1 < n; ++k) {
    const double pivot = 2.0 * (width(k - 1) + width(k)) - width(k - 1) * above[k - 1];
    above[k] = width(k) / pivot;
    bend[k] = (6.0 * (slope(k) - slope(k - 1)) - width(k - 1) * bend[k - 1]) / pivot;
  }
  for (std::size_t k = n - 1; k-- > 1;) bend[k] -= above[k] * bend[k + 1];
  return bend;
}

}  // namespace

LookupTable table_of(const SceneDocument::Input& input) {
  using Kind = SceneDocument::Input::Kind;
  const std::vector<double>&x = input.times, &y = input.values;
  LookupTable table{input.kind == Kind::step     ? 0
                    : input.kind == Kind::linear ? 1
                                                 : 3,
                    x,
                    {y.front(), 0, 0, 0}};
  const auto add = [&](double c0, double c1, double c2, double c3) {
    table.coefficients.insert(table.coefficients.end(), {c0, c1, c2, c3});
  };
  const std::vector<double> bend =
      input.kind == Kind::cubic ? bends(x, y) : std::vector<double>(x.size(), 0.0);
  for (std::size_t k = 0; k + 1 < x.size(); ++k) {
    const double h = x[k + 1] - x[k], slope = (y[k + 1] - y[k]) / h;
    if (input.kind == Kind::step)
      add(y[k], 0.0, 0.0, 0.0);
    else if (input.kind == Kind::linear)
      add(y[k], slope, 0.0, 0.0);
    else
      add(y[k], slope - h * (2.0 * bend[k] + bend[k + 1]) / 6.0, bend[k] / 2.0,
          (bend[k + 1] - bend[k]) / (6.0 * h));
  }
  add(y.back(), 0.0, 0.0, 0.0);
  return table;
}

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
