#include "rows.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "differences.hpp"
#include "misuse.hpp"
#include "scenes.hpp"

namespace diracstep {
namespace {

using testing::difference_jacobian;
using testing::full;
using testing::RowsAt;

const double t = 0.7;
const Vector q{{0.4, -0.9, 1.3}}, v{{0.8, 0.5, -0.6}};

/// Every kind of rows, with and without the time.
std::vector<std::shared_ptr<const ConstraintRows>> every_kind() {
  return {testing::moving_pfaffian(), testing::moving_affine(), testing::moving_holonomic(),
          testing::nonholonomic()->constraints[0], testing::holonomic_sphere()->constraints[0]};
}

Eigen::MatrixXd form(const ConstraintRows& rows, double time, const Vector& at) {
  return full(rows.pattern(), RowsAt(rows, time, at).values);
}

/// Error of central differences of step 1e-5 for terms of size 1.
void expect_close(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  ASSERT_EQ(a.rows(), b.rows());
  ASSERT_EQ(a.cols(), b.cols());
  EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-8) << a << "\n\n" << b;
}

TEST(Rows, PfaffianCoefficientsAreTheFormulaAndHaveNoOffset) {
  const auto rows = testing::moving_pfaffian();
  Eigen::MatrixXd expected(2, 3);
  expected << std::sin(q[2] + t), -std::cos(q[2]), q[0] * q[1], 1.0, t * q[0], std::exp(0.3 * q[1]);
  EXPECT_EQ(form(*rows, t, q), expected);
  EXPECT_EQ(RowsAt(*rows, t, q).b, Vector::Zero(2));
  EXPECT_FALSE(rows->holonomic());
}

TEST(Rows, AffineCoefficientsAreBothFormulas) {
  const auto rows = testing::moving_affine();
  EXPECT_EQ(form(*rows, t, q), form(*testing::moving_pfaffian(), t, q));
  EXPECT_EQ(RowsAt(*rows, t, q).b, (Vector{{0.5 * t * t * q[1], q[0] * q[2] - 2.0 * t}}));
  EXPECT_FALSE(rows->holonomic());
}

TEST(Rows, HolonomicCoefficientsAreTheDerivativesOfThePosition) {
  const auto rows = testing::moving_holonomic();
  EXPECT_TRUE(rows->holonomic());
  const auto position = [&](double time, const Vector& at) {
    Vector phi(2);
    rows->position(time, at, phi);
    return phi;
  };
  EXPECT_EQ(position(t, q),
            (Vector{{q[0] * q[0] + q[1] * q[2] - t * q[0], std::sin(q[2] * t) + q[1] - 0.3 * t * t * t}}));
  expect_close(form(*rows, t, q), difference_jacobian([&](const Vector& at) { return position(t, at); }, q));
  expect_close(
      RowsAt(*rows, t, q).b,
      difference_jacobian([&](const Vector& time) { return position(time[0], q); }, Vector::Constant(1, t)));
}

TEST(Rows, OnlyHolonomicRowsHaveAPosition) {
  Vector phi(2);
  EXPECT_THROW(testing::moving_affine()->position(t, q, phi), Misuse);
}

TEST(Rows, DerivativeIsThatOfTheFormAlongAVelocity) {
  for (const auto& rows : every_kind())
    for (const double s : {0.0, 1.0, -0.4}) {
      Vector d(rows->pattern().nonzeros());
      rows->derivative(t, q, v, s, d);
      const auto along = [&](const Vector& at) {
        return Vector(form(*rows, t, at) * v + s * RowsAt(*rows, t, at).b);
      };
      expect_close(full(rows->pattern(), d), difference_jacobian(along, q));
    }
}

TEST(Rows, TimeDerivativeIsThatOfTheVelocityResidual) {
  for (const auto& rows : every_kind()) {
    Vector d(rows->rows());
    rows->time_derivative(t, q, v, d);
    const auto residual = [&](const Vector& time) {
      return Vector(form(*rows, time[0], q) * v + RowsAt(*rows, time[0], q).b);
    };
    expect_close(d, difference_jacobian(residual, Vector::Constant(1, t)));
  }
}

TEST(Rows, AnnihilatorDerivativeIsThatOfTheForce) {
  for (const auto& rows : every_kind()) {
    const Vector lambda = Vector::LinSpaced(rows->rows(), 0.9, -1.4);
    Vector d(rows->curvature_pattern().nonzeros());
    rows->annihilator_derivative(t, q, lambda, d);
    const auto force = [&](const Vector& at) { return Vector(form(*rows, t, at).transpose() * lambda); };
    expect_close(full(rows->curvature_pattern(), d), difference_jacobian(force, q));
  }
}

TEST(Rows, AnnihilatorDerivativeOfHolonomicRowsIsSymmetricOfOthersNot) {
  const auto asymmetry = [](const ConstraintRows& rows) {
    Vector d(rows.curvature_pattern().nonzeros());
    rows.annihilator_derivative(t, q, Vector::Ones(rows.rows()), d);
    const Eigen::MatrixXd matrix = full(rows.curvature_pattern(), d);
    return (matrix - matrix.transpose()).cwiseAbs().maxCoeff();
  };
  EXPECT_EQ(asymmetry(*testing::moving_holonomic()), 0.0);
  EXPECT_GT(asymmetry(*testing::moving_pfaffian()), 0.1);
}

TEST(Rows, NamesAreNumbersWhereNoneAreGiven) {
  EXPECT_EQ(testing::moving_affine()->names(), (std::vector<std::string>{"1", "2"}));
  EXPECT_EQ(testing::moving_holonomic()->names(), (std::vector<std::string>{"1", "2"}));
  EXPECT_EQ(testing::nonholonomic()->constraints[0]->names(), std::vector<std::string>{"contact"});
}

TEST(Rows, AWrongNumberOfNamesIsRefusedWithBothNumbers) {
  const auto parts = {std::string("row names"), std::string("3"), std::string("expected 2")};
  const std::vector<std::string> three{"a", "b", "c"};
  testing::expect_misuse([&] { (void)pfaffian<3, 2>(testing::MovingForms{}, three); }, parts);
  testing::expect_misuse([&] { (void)affine<3, 2>(testing::MovingForms{}, testing::MovingOffset{}, three); },
                         parts);
  testing::expect_misuse([&] { (void)holonomic<3, 2>(testing::MovingSurfaces{}, three); }, parts);
}

}  // namespace
}  // namespace diracstep
