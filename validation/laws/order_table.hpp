#pragma once

#include <diracstep/core/methods/registry.hpp>
#include <diracstep/validation/laws/conformance.hpp>
#include <functional>
#include <string>
#include <vector>

namespace diracstep {

/// Claimed and measured order of one method, composed or not, on every constraint class, and its defects.
struct OrderTableRow {
  std::string method;
  int order = 0;                           ///< claimed
  std::vector<OrderMeasurement> measured;  ///< one for each of order_scenes()
  double reversal_defect = 0.0;  ///< on the mixed scene, h = 0.05; NaN where the method is not self-adjoint
  double symplecticity_defect = 0.0;  ///< on the unconstrained scene, h = 0.05; NaN for a composition
  /// Largest over the constraint classes, 20 steps of h = 0.05; of GL(s) with rows in the stage space.  NaN
  /// where none is stated.
  double membership_residual = 0.0;
  std::vector<int> claimed = {};  ///< order on each class where it is not the same on all; else empty
};

/// One line of the table is one of these.
struct TableMethod {
  std::string name;
  int order;
};

/// Every method of the registry with its own order, the symmetric compositions of those of order 1,
/// type1/midpoint composed to 4, 6 and 8, and an explicit step and a symmetrised pair composed to 4.
std::vector<TableMethod> table_methods(const Registry& registry);

/// Measures a row.
OrderTableRow measure_row(const Registry& registry, const TableMethod& method,
                          const std::vector<OrderScene>& scenes);

/// Whether claim and measurement agree within 0.2 on every class the method takes.  A method measured above
/// its claim fails too: the claim is then wrong.
bool holds(const OrderTableRow& row);

/// The order of one method, composed or not, with each rule for the nonholonomic rows, left, right, midpoint
/// and trapezoidal, on a nonlinear nonholonomic scene.
struct RuleRow {
  std::string method;
  int order = 0;  ///< claimed with the method's own rule
  std::vector<OrderMeasurement> measured;
  std::vector<int> expected;  ///< 1 with a one-sided rule, else the claim
};
std::vector<RuleRow> measure_rules(const Registry& registry, const OrderScene& nonholonomic);

/// The order of a method on a degenerate circuit.
struct CircuitRow {
  std::string method;
  int order = 0;
  OrderMeasurement measured;
};
std::vector<CircuitRow> measure_circuit(const Registry& registry);

/// Whether measured and expected agree within 0.2.
bool holds(const RuleRow& row);
bool holds(const CircuitRow& row);

/// Both as Markdown, with what they say.
std::string rule_table_markdown(const std::vector<RuleRow>& rows);
std::string circuit_table_markdown(const std::vector<CircuitRow>& rows);

/// The table as Markdown, for the documentation.
std::string order_table_markdown(const std::vector<OrderTableRow>& rows,
                                 const std::vector<OrderScene>& scenes);

}  // namespace diracstep
