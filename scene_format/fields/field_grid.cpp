#include <fmt/format.h>

#include <algorithm>
#include <diracstep/scene_format/fields/field_grid.hpp>
#include <functional>

namespace diracstep::scene_compiler {

namespace {

/// The texts with these factors, as a sum in parentheses.
std::string combination(ConstVectorRef factors, const std::function<std::string(int)>& text) {
  std::string sum;
  for (int k = 0; k < static_cast<int>(factors.size()); ++k) {
    if (factors[k] == 0.0) continue;
    const double size = std::abs(factors[k]);
    sum += factors[k] < 0.0 ? (sum.empty() ? "-" : " - ") : (sum.empty() ? "" : " + ");
    sum += size == 1.0 ? text(k) : fmt::format("{:.17g}*{}", size, text(k));
  }
  return '(' + (sum.empty() ? "0" : sum) + ')';
}

std::string place_in(const std::string& from, const std::string& cell, double share) {
  return fmt::format("(({}) + ({} + {:.17g})*dx)", from, cell, share - 1.0);
}

}  // namespace

std::vector<FieldGrid::Family> FieldGrid::families(const Field& field) const {
  std::vector<Family> all{{field.name,
                           fmt::format("cell = {}..cells{}", !periodic && field.left.given ? 2 : 1,
                                       periodic || field.right.given ? "" : "+1"),
                           place_in(from, "cell", 0.0)}};
  for (int r = 1; r < element.degree; ++r)
    all.push_back(
        {fmt::format("{}_i{}", field.name, r), "cell = 1..cells", place_in(from, "cell", element.nodes[r])});
  return all;
}

std::string FieldGrid::end(bool right) const {
  return right ? fmt::format("(({}) + ({}))", from, length) : '(' + from + ')';
}

bool FieldGrid::alike() const {
  return periodic && std::ranges::all_of(fields, [](const Field& field) { return field.jump.empty(); });
}

std::string FieldGrid::integral(const std::string& formula) const {
  if (alike()) return fmt::format("sum(cell = 1..cells, {})", cell_integral(formula, "cell"));
  return fmt::format("sum(cell = 2..cells-1, {}) + {} + {}", cell_integral(formula, "cell"),
                     cell_integral(formula, "1"), cell_integral(formula, "cells"));
}

std::string FieldGrid::cell_integral(const std::string& formula, const std::string& cell) const {
  std::string sum;
  for (Eigen::Index k = 0; k < element.points.size(); ++k) {
    if (k > 0) sum += " + ";
    if (element.weights[k] != 1.0) sum += fmt::format("{:.17g}*", element.weights[k]);
    sum += '(' + with_names_replaced(formula, at_point(cell, k)) + ')';
  }
  return "dx*(" + sum + ')';
}

NameTexts FieldGrid::at_point(const std::string& cell, Eigen::Index point) const {
  NameTexts texts{{"x", place_in(from, cell, element.points[point])}};
  const Vector values = element.values.row(point), slopes = element.slopes.row(point);
  for (const Field& field : fields) {
    const auto position = [&](int r) { return node(field, cell, r, false); };
    const auto velocity = [&](int r) { return node(field, cell, r, true); };
    texts[field.name] = combination(values, position);
    texts[field.name + "_t"] = combination(values, velocity);
    texts[field.name + "_x"] = '(' + combination(slopes, position) + "/dx)";
  }
  return texts;
}

std::string FieldGrid::node(const Field& field, const std::string& cell, int number, bool velocity) const {
  const std::string prefix = velocity ? "v_" : "";
  const auto value_at_end = [&](const FieldEnd& end) {
    return velocity ? "rate(" + end.value + ')' : '(' + end.value + ')';
  };
  if (number == 0 && cell == "1" && !periodic && field.left.given) return value_at_end(field.left);
  if (number == 0) return fmt::format("{}{}[{}]", prefix, field.name, cell);
  if (number < element.degree) return fmt::format("{}{}_i{}[{}]", prefix, field.name, number, cell);
  if (cell == "cells" && periodic) {  // the first node once more
    const std::string first = prefix + field.name + "[1]";
    return velocity || field.jump.empty() ? first : fmt::format("({} + ({}))", first, field.jump);
  }
  if (cell == "cells" && field.right.given) return value_at_end(field.right);
  return fmt::format("{}{}[{}+1]", prefix, field.name, cell);
}

}  // namespace diracstep::scene_compiler
