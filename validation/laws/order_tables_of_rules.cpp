#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/validation/laws/order_table.hpp>

/// Two further order tables: the rules for Δ^d_Q, and degenerate circuits.
namespace diracstep {

namespace {

constexpr std::array rules{StepRule::left, StepRule::right, StepRule::midpoint, StepRule::trapezoidal};

constexpr const char* rule_explanation =
    "## The rule for the rows\n\n"
    "The same on the nonholonomic scene, with each rule for the rows in place of the method's own. A "
    "one-sided\n"
    "rule takes a method to order 1, and composing does not raise it. A method of order 1 composed with its\n"
    "adjoint stays at 2 with every rule, since the adjoint half takes the mirrored one.\n\n"
    "| method | claimed |";

constexpr const char* circuit_explanation =
    "## Degenerate circuits\n\n"
    "The same on a driven circuit with a loop of non-linear capacitors, whose Lagrangian is singular along "
    "the\n"
    "rows (`core/system/hidden_rows.hpp`). Methods that need a Hamiltonian are left out: it has none.\n\n"
    "| method | claimed | measured |\n|---|---|---|\n";

bool agrees(const OrderMeasurement& measured, int expected) {
  return measured.failure.empty() && std::abs(measured.order - expected) <= 0.2;
}

std::string measured_cell(const OrderMeasurement& measured) {
  return std::isfinite(measured.order) ? fmt::format("{:.2f}", measured.order) : "**failed**";
}

bool one_sided(StepRule rule) { return rule == StepRule::left || rule == StepRule::right; }

/// A one-sided method composed with its adjoint takes the mirrored rule in the adjoint half, so that the
/// whole is symmetric with any rule; a self-adjoint one is symmetric with symmetric rules only.
int expected_order(const MethodInfo& info, int order, StepRule rule) {
  const bool symmetric = info.order == 1 ? order == 2 : !one_sided(rule);
  return symmetric ? order : 1;
}

}  // namespace

std::vector<RuleRow> measure_rules(const Registry& registry, const OrderScene& nonholonomic) {
  std::vector<RuleRow> rows;
  const std::array<TableMethod, 7> methods{TableMethod{"type1/left", 1},
                                           {"type1/left", 2},
                                           {"type1/midpoint", 2},
                                           {"type1/midpoint", 4},
                                           {"type1/trapezoidal", 2},
                                           {"type1/trapezoidal", 4},
                                           {"type2/legendre(type1/midpoint)", 2}};
  for (const TableMethod& method : methods) {
    RuleRow row{method.name, method.order, {}, {}};
    for (const StepRule& rule : rules) {
      const IntegratorOptions options{.method = method.name, .order = method.order, .constraint_rule = rule};
      row.measured.push_back(measure_order(registry, nonholonomic, options));
      row.expected.push_back(expected_order(registry.method(method.name).info, method.order, rule));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

std::vector<CircuitRow> measure_circuit(const Registry& registry) {
  const OrderScene scene = degenerate_order_scene();
  std::vector<CircuitRow> rows;
  for (const TableMethod& method : table_methods(registry)) {
    const MethodInfo info = registry.method(method.name).info;
    const bool duplicate = method.name.starts_with("type2/gl") || method.name.starts_with("type3/gl");
    const bool from_lagrangian =
        !info.type || info.type == GeneratingType::one || method.name.find("legendre") != std::string::npos;
    if (duplicate || !from_lagrangian) continue;
    const IntegratorOptions options{.method = method.name, .order = method.order};
    rows.push_back({method.name, method.order, measure_order(registry, scene, options)});
  }
  return rows;
}

bool holds(const RuleRow& row) {
  for (std::size_t k = 0; k < row.measured.size(); ++k)
    if (!agrees(row.measured[k], row.expected[k])) return false;
  return true;
}

bool holds(const CircuitRow& row) { return agrees(row.measured, row.order); }

std::string rule_table_markdown(const std::vector<RuleRow>& rows) {
  std::string text = rule_explanation;
  for (const StepRule& rule : rules) text += fmt::format(" {} |", name(rule));
  text += "\n|---|---|---|---|---|---|\n";
  for (const RuleRow& row : rows) {
    text += fmt::format("| `{}` | {} |", row.method, row.order);
    for (const OrderMeasurement& measured : row.measured)
      text += fmt::format(" {} |", measured_cell(measured));
    text += '\n';
  }
  return text;
}

std::string circuit_table_markdown(const std::vector<CircuitRow>& rows) {
  std::string text = circuit_explanation;
  for (const CircuitRow& row : rows)
    text += fmt::format("| `{}` | {} | {} |\n", row.method, row.order, measured_cell(row.measured));
  return text;
}

}  // namespace diracstep
