#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/methods/composition.hpp>
#include <diracstep/validation/laws/law_scenes.hpp>
#include <diracstep/validation/laws/order_table.hpp>

namespace diracstep {

namespace {

constexpr double defect_step = 0.05;

bool degenerate(const OrderScene& scene) { return scene.scene->lagrangian->structure().y_hessian_zero; }

std::string number(double value) { return std::isfinite(value) ? fmt::format("{:.1e}", value) : "–"; }

std::string cell(const OrderMeasurement& measured) {
  if (std::isfinite(measured.order)) return fmt::format("{:.2f}", measured.order);
  return measured.failure.empty() ? "–" : "**failed**";
}

}  // namespace

std::vector<TableMethod> table_methods(const Registry& registry) {
  std::vector<TableMethod> methods;
  for (const std::string& name : registry.names()) {
    const MethodInfo info = registry.method(name).info;
    methods.push_back({name, info.order});
    if (info.order == 1 && !info.self_adjoint && !info.damped) methods.push_back({name, 2});
    if (name == "type1/midpoint")
      for (const int order : composition_orders)
        if (order > info.order && order <= highest_visible_order) methods.push_back({name, order});
    if (name == "type1/trapezoidal" || name == "type2/euler") methods.push_back({name, 4});
  }
  return methods;
}

OrderTableRow measure_row(const Registry& registry, const TableMethod& method,
                          const std::vector<OrderScene>& scenes) {
  OrderTableRow row{method.name, method.order, {}, 0.0, 0.0, 0.0};
  const IntegratorOptions options{.method = method.name, .order = method.order, .step = defect_step};
  const Method known = registry.method(method.name);
  const MethodInfo& info = known.info;
  const bool composed = method.order != info.order;
  for (const OrderScene& scene : scenes) {
    OrderMeasurement measured{std::nan(""), 0.0, 0.0, {}, false};
    if (takes(known, scene)) measured = measure_order(registry, scene, options);
    row.measured.push_back(measured);
    if (!composed && info.constrained_order > 0) row.claimed.push_back(claimed_order(info, *scene.scene));
    if (composed || scene.scene->force || degenerate(scene)) continue;
    const double residual = membership_residual(registry, scene.scene, options, 20);
    row.membership_residual = std::max(row.membership_residual, residual);
    if (std::isnan(residual)) row.membership_residual = residual;
  }
  const bool symmetric = info.self_adjoint || composed;
  row.reversal_defect = symmetric ? reversal_defect(registry, laws::mixed(), options) : std::nan("");
  row.symplecticity_defect =
      composed || info.damped ? std::nan("") : symplecticity_defect(registry, laws::unconstrained(), options);
  if (composed) row.membership_residual = std::nan("");
  return row;
}

bool holds(const OrderTableRow& row) {
  for (std::size_t k = 0; k < row.measured.size(); ++k) {
    const OrderMeasurement& measured = row.measured[k];
    const int claimed = row.claimed.empty() ? row.order : row.claimed[k];
    if (!measured.failure.empty() || std::abs(measured.order - claimed) > 0.2) return false;
  }
  return true;
}

std::string order_table_markdown(const std::vector<OrderTableRow>& rows,
                                 const std::vector<OrderScene>& scenes) {
  std::string text = "| method | claimed |";
  std::string rule = "|---|---|";
  for (const OrderScene& scene : scenes) {
    text += fmt::format(" {} |", scene.constraint_class);
    rule += "---|";
  }
  text += fmt::format(" reversal | symplecticity | membership |\n{}---|---|---|\n", rule);
  for (const OrderTableRow& row : rows) {
    text += fmt::format("| `{}` | {} |", row.method, row.order);
    for (const OrderMeasurement& measured : row.measured) text += fmt::format(" {} |", cell(measured));
    text += fmt::format(" {} | {} | {} |\n", number(row.reversal_defect), number(row.symplecticity_defect),
                        number(row.membership_residual));
  }
  return text;
}

}  // namespace diracstep
