#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/files/paths.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/validation/laws/order_table.hpp>
#include <memory>

namespace diracstep::command {

namespace {

struct OrdersArguments {
  std::string out;
  bool json = false;
};

constexpr const char* explanation =
    "# Orders, claimed and measured\n\n"
    "Written by `diracstep orders --out FILE`. Each number is the slope of log(error) over log(h), the "
    "error\n"
    "being the largest in q, projected p and the forces of the rows at t = 6, on non-linear scenes without "
    "a\n"
    "special symmetry (`validation/laws/law_scenes.hpp`), against GL(6) at h = 0.025; errors at round-off "
    "are "
    "left\n"
    "out.\n\n"
    "* *reversal*: |Φ_{-h}(Φ_h(y)) - y| on the mixed scene, h = 0.05, for self-adjoint steps.\n"
    "* *symplecticity*: largest entry of MᵀΩM - Ω on the unconstrained scene, M by sixth-order differences.\n"
    "* *membership*: largest residual of membership in the discrete Dirac structures over 20 steps of every "
    "class;\n"
    "  for GL(s) with rows, in the Dirac structure of its stage space "
    "(`validation/laws/stage_membership.hpp`).\n\n"
    "A dash: not stated for that method, or it does not take that class: type 4 takes no forces; only the\n"
    "Gauss-Lobatto family, which type1/midpoint belongs to, and the damping family are stable on "
    "phase-space\n"
    "Lagrangians.\n\n"
    "Not in the table: compositions of order 10. In double precision their leading error reaches round-off "
    "before\n"
    "it dominates those of higher order, so slopes of 9 to 15 are seen here; in extended precision the order "
    "is 10\n"
    "(`tests/core/methods/composition_test.cpp`, with all order conditions).\n\n";

Json as_json(const RuleRow& row) {
  Json json{{"method", row.method}, {"order", row.order}, {"measured", Json::array()}};
  for (const OrderMeasurement& measured : row.measured) json["measured"].push_back(measured.order);
  json["holds"] = holds(row);
  return json;
}

Json as_json(const OrderTableRow& row, const std::vector<OrderScene>& scenes) {
  Json json{{"method", row.method}, {"order", row.order}, {"measured", Json::object()}};
  for (std::size_t k = 0; k < scenes.size(); ++k)
    json["measured"][scenes[k].constraint_class] = row.measured[k].order;
  json["reversal_defect"] = row.reversal_defect;
  json["symplecticity_defect"] = row.symplecticity_defect;
  json["membership_residual"] = row.membership_residual;
  json["holds"] = holds(row);
  return json;
}

void orders(const OrdersArguments& options, Session& session) {
  if (!options.out.empty()) require_outputs({{"--out", options.out}}, {});
  catch_interrupts();
  const std::vector<OrderScene> scenes = order_scenes();
  std::vector<OrderTableRow> rows;
  for (const TableMethod& method : table_methods(session.registry)) {
    if (interrupted()) break;
    rows.push_back(measure_row(session.registry, method, scenes));
  }
  std::vector<RuleRow> rules;
  std::vector<CircuitRow> circuits;
  const auto nonholonomic = std::ranges::find(scenes, "nonholonomic", &OrderScene::constraint_class);
  if (!interrupted()) rules = measure_rules(session.registry, *nonholonomic);
  if (!interrupted()) circuits = measure_circuit(session.registry);
  const std::string table = order_table_markdown(rows, scenes) + '\n' + rule_table_markdown(rules) + '\n' +
                            circuit_table_markdown(circuits);
  if (!options.out.empty()) {
    replace_file(options.out, explanation + table);
  }
  Json json{{"orders", Json::array()}};
  for (const OrderTableRow& row : rows) json["orders"].push_back(as_json(row, scenes));
  json["rules"] = Json::array();
  for (const RuleRow& row : rules) json["rules"].push_back(as_json(row));
  json["circuits"] = Json::array();
  for (const CircuitRow& row : circuits)
    json["circuits"].push_back({{"method", row.method},
                                {"order", row.order},
                                {"measured", row.measured.order},
                                {"holds", holds(row)}});
  print(options.json ? to_text(json, 2) + '\n' : table);
  if (interrupted()) {
    say("interrupted; what was measured is there");
    session.exit_status = failed;
  }
  for (const OrderTableRow& row : rows)
    if (!holds(row)) {
      say(fmt::format("{} composed to order {}: claim and measurement differ", row.method, row.order));
      session.exit_status = failed;
    }
  const bool rest_holds = std::ranges::all_of(rules, [](const RuleRow& row) { return holds(row); }) &&
                          std::ranges::all_of(circuits, [](const CircuitRow& row) { return holds(row); });
  if (rest_holds) return;
  say("the rules or the circuits: claim and measurement differ");
  session.exit_status = failed;
}

}  // namespace

void add_orders(CLI::App& app, Session& session) {
  CLI::App* verb =
      app.add_subcommand("orders", "Claimed and measured order of every method on every constraint class");
  const auto options = std::make_shared<OrdersArguments>();
  verb->add_option("--out", options->out, "Also write the table, with its explanation, as Markdown");
  verb->add_flag("--json", options->json, "One JSON document on standard output");
  verb->footer("Example:  diracstep orders --out docs/orders.md");
  verb->callback([options, &session] { orders(*options, session); });
}

}  // namespace diracstep::command
