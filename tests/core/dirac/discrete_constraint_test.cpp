#include <gtest/gtest.h>

#include <diracstep/core/dirac/discrete_constraint.hpp>

#include "differences.hpp"
#include "rows.hpp"
#include "scenes.hpp"

namespace diracstep {
namespace {

using testing::difference_jacobian;
using testing::full;
using testing::RowsAt;

const Interval step{0.7, 0.2};
const Vector q0{{0.4, -0.9, 1.3}}, q1{{0.55, -0.7, 1.2}};

/// c(q0,q1) and ∂c/∂q1 of some rows by one rule.
class Discrete {
 public:
  Discrete(const ConstraintBlocks& blocks, StepRule rule) : constraint_(blocks, 3, rule) {}

  Vector at(Interval interval, const Vector& a, const Vector& b) {
    Vector c(constraint_.rows());
    constraint_.residual(interval, a, b, c);
    return c;
  }
  Eigen::MatrixXd end_derivative(Interval interval, const Vector& a, const Vector& b) {
    Vector d(constraint_.pattern().nonzeros());
    constraint_.end_derivative(interval, a, b, d);
    return full(constraint_.pattern(), d);
  }

 private:
  DiscreteConstraint constraint_;
};

class EveryRule : public ::testing::TestWithParam<StepRule> {
 protected:
  Discrete discrete(const ConstraintBlocks& blocks) const { return {blocks, GetParam()}; }
};

TEST_P(EveryRule, LinearRowsContainTheDiagonal) {
  const Vector c =
      discrete({testing::moving_pfaffian(), testing::nonholonomic()->constraints[0]}).at(step, q0, q0);
  EXPECT_EQ(c, Vector::Zero(3));
}

TEST_P(EveryRule, HolonomicRowsContainTheDiagonalOfTheirSurface) {
  const auto scene = testing::holonomic_sphere();
  EXPECT_NEAR(discrete(scene->constraints).at(step, scene->start.q, scene->start.q)[0], 0.0, 4e-16);
}

TEST_P(EveryRule, DerivativeOnTheDiagonalInducesTheDistribution) {
  const auto rows = testing::nonholonomic()->constraints[0];
  const Eigen::MatrixXd a = full(rows->pattern(), RowsAt(*rows, 0.0, q0).values);
  EXPECT_LT((discrete({rows}).end_derivative(step, q0, q0) - a).cwiseAbs().maxCoeff(), 2e-16);
}

TEST_P(EveryRule, DerivativeOnTheDiagonalIsTheWeightedSumOverTheNodes) {
  const auto rows = testing::moving_pfaffian();
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(2, 3);
  for (const StepNode& node : step_nodes(GetParam()))
    sum += node.weight * full(rows->pattern(), RowsAt(*rows, step.start + node.c * step.size, q0).values);
  EXPECT_LT((discrete({rows}).end_derivative(step, q0, q0) - sum).cwiseAbs().maxCoeff(), 2e-16);
}

TEST_P(EveryRule, EndDerivativeAgreesWithDifferencesForAllKindsOfRowsTogether) {
  Discrete c = discrete({testing::moving_affine(), testing::moving_holonomic(), testing::moving_pfaffian()});
  for (const Interval interval : {step, Interval{0.7, -0.4}}) {
    const auto by_end = difference_jacobian([&](const Vector& b) { return c.at(interval, q0, b); }, q1);
    EXPECT_LT((c.end_derivative(interval, q0, q1) - by_end).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST_P(EveryRule, AffineRowsAreTheWeightedSumOverTheNodes) {
  const auto rows = testing::moving_affine();
  Vector sum = Vector::Zero(2);
  for (const StepNode& node : step_nodes(GetParam())) {
    const RowsAt at(*rows, step.start + node.c * step.size, (1.0 - node.c) * q0 + node.c * q1);
    sum += node.weight * (full(rows->pattern(), at.values) * (q1 - q0) + step.size * at.b);
  }
  EXPECT_LT((discrete({rows}).at(step, q0, q1) - sum).lpNorm<Eigen::Infinity>(), 4e-16);
}

TEST_P(EveryRule, HolonomicRowsAreThePositionAtTheEnd) {
  const auto rows = testing::moving_holonomic();
  Vector phi(2);
  rows->position(step.end(), q1, phi);
  EXPECT_EQ(discrete({rows}).at(step, q0, q1), phi);
  EXPECT_EQ(discrete({rows}).at(step, 3.0 * q0, q1), phi);
}

TEST_P(EveryRule, BlocksStackInTheirOrder) {
  const auto affine = testing::moving_affine(), holonomic = testing::moving_holonomic();
  const Vector both = discrete({affine, holonomic}).at(step, q0, q1);
  EXPECT_EQ(both.head(2), discrete({affine}).at(step, q0, q1));
  EXPECT_EQ(both.tail(2), discrete({holonomic}).at(step, q0, q1));
}

/// A curve in the distribution v_x + y v_z = 0.
Vector contact_curve(double t) {
  return Vector{{2.0 * t * std::cos(t) - 2.0 * std::sin(t), std::sin(t), t * t}};
}

TEST_P(EveryRule, DefectOnACurveInTheDistributionHasTheOrderOfTheRule) {
  Discrete c = discrete(testing::nonholonomic()->constraints);
  const auto defect = [&](double size) {
    return std::abs(c.at({1.0, size}, contact_curve(1.0), contact_curve(1.0 + size))[0]);
  };
  const bool one_sided = GetParam() == StepRule::left || GetParam() == StepRule::right;
  EXPECT_NEAR(std::log2(defect(0.01) / defect(0.005)), one_sided ? 2.0 : 3.0, 0.05);
}

TEST_P(EveryRule, MirroredRuleIsTheSameConstraintReadBackwards) {
  const ConstraintBlocks blocks{testing::moving_affine()};
  Discrete mirror(blocks, mirrored(GetParam()));
  const Vector there = discrete(blocks).at(step, q0, q1);
  const Vector back = mirror.at({step.end(), -step.size}, q1, q0);
  EXPECT_LT((there + back).lpNorm<Eigen::Infinity>(), 4e-16);
}

INSTANTIATE_TEST_SUITE_P(DiscreteConstraint, EveryRule,
                         ::testing::Values(StepRule::left, StepRule::right, StepRule::midpoint,
                                           StepRule::trapezoidal),
                         [](const auto& test) { return std::string(name(test.param)); });

}  // namespace
}  // namespace diracstep
