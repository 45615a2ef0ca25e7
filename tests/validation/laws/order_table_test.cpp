#include <gtest/gtest.h>

#include <cctype>
#include <cmath>
#include <diracstep/validation/laws/order_table.hpp>

namespace diracstep {
namespace {

const std::vector<OrderScene>& scenes() {
  static const std::vector<OrderScene> all = order_scenes();
  return all;
}

std::string label(std::string name) {
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
}

class OrderTable : public ::testing::TestWithParam<TableMethod> {};

TEST_P(OrderTable, ClaimAndMeasurementAgreeOnEveryConstraintClass) {
  const OrderTableRow row = measure_row(Registry::with_built_ins(), GetParam(), scenes());
  EXPECT_TRUE(holds(row));
  for (std::size_t k = 0; k < scenes().size(); ++k)
    if (!std::isnan(row.measured[k].order)) {
      EXPECT_NEAR(row.measured[k].order, row.order, 0.2) << scenes()[k].constraint_class;
    }
  if (!std::isnan(row.reversal_defect)) {
    EXPECT_LT(row.reversal_defect, 1e-13);
  }
  if (!std::isnan(row.symplecticity_defect)) {
    EXPECT_LT(row.symplecticity_defect, 1e-10);
  }
  if (!std::isnan(row.membership_residual)) {
    EXPECT_LT(row.membership_residual, 1e-12);
  }
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, OrderTable,
                         ::testing::ValuesIn(table_methods(Registry::with_built_ins())),
                         [](const auto& test) {
                           const bool slow = test.param.name.ends_with("/euler") && test.param.order > 2;
                           return label(test.param.name) + "_order_" + std::to_string(test.param.order) +
                                  (slow ? "_slow" : "");
                         });

TEST(OrderTable, AOneSidedRuleForTheRowsIsFoundOut) {
  const Registry registry = Registry::with_built_ins();
  for (const OrderScene& scene : scenes()) {
    if (scene.constraint_class != "nonholonomic") continue;
    const OrderMeasurement measured =
        measure_order(registry, scene, {.method = "type1/midpoint", .constraint_rule = StepRule::left});
    EXPECT_NEAR(measured.order, 1.0, 0.1);
    EXPECT_FALSE(holds({"type1/midpoint", 2, {measured}, 0.0, 0.0, 0.0}));
  }
}

TEST(OrderTable, EveryRuleForTheRowsHasTheOrderThatIsStated) {
  for (const OrderScene& scene : scenes()) {
    if (scene.constraint_class != "nonholonomic") continue;
    const std::vector<RuleRow> rows = measure_rules(Registry::with_built_ins(), scene);
    EXPECT_EQ(rows.size(), 7U);
    for (const RuleRow& row : rows) EXPECT_TRUE(holds(row)) << row.method << " of order " << row.order;
    RuleRow wrong = rows[2];  // type1/midpoint with the left rule is of order 1
    wrong.expected[0] = 2;
    EXPECT_FALSE(holds(wrong));
  }
}

TEST(OrderTable, DegenerateCircuitsKeepEveryOrder) {
  const std::vector<CircuitRow> rows = measure_circuit(Registry::with_built_ins());
  EXPECT_GT(rows.size(), 20U);
  for (const CircuitRow& row : rows)
    EXPECT_TRUE(holds(row)) << row.method << " of order " << row.order << " measured " << row.measured.order;
}

TEST(OrderTable, TheUnprojectedMomentumIsOneOrderLower) {
  const Registry registry = Registry::with_built_ins();
  for (const OrderScene& scene : scenes()) {
    if (scene.constraint_class != "nonholonomic") continue;
    const OrderMeasurement measured =
        measure_order(registry, scene, {.method = "type1/midpoint"}, Momentum::plus);
    EXPECT_NEAR(measured.order, 1.0, 0.1);
  }
}

}  // namespace
}  // namespace diracstep
