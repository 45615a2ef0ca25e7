#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/numerics/dependence.hpp>
#include <diracstep/core/numerics/jet.hpp>
#include <limits>

namespace diracstep {
namespace {

/// A formula that goes through every operation and function a user may write.
template <class T>
T everything(const T& x, const T& y) {
  using std::abs, std::acos, std::asin, std::atan, std::atan2, std::cos, std::cosh, std::exp, std::hypot,
      std::log, std::pow, std::sin, std::sinh, std::sqrt, std::tan, std::tanh;
  T z = sin(x) * cos(y) + exp(x * y) / (1.0 + x * x) - log(2.0 + x) * sqrt(1.0 + y * y);
  z += tan(0.3 * x) - atan(y) + asin(0.4 * x) * acos(0.3 * y) + sinh(0.5 * x) + cosh(y) - tanh(x * y);
  z -= pow(1.0 + x * x, 1.5) * pow(2.0 + y, x);
  z *= 1.0 + 0.1 * abs(x - y);
  z /= 2.0 - 1.0 / (3.0 + x);
  return z + atan2(x, y) * hypot(x, y) + 2.0 * (-x) - (+y) / 4.0 + (1.0 - x) * (y - 1.0);
}

TEST(Jet, AgreesWithDifferencesInEveryOperation) {
  const double x = 0.7, y = -0.4;
  using J = Jet<2, 2>;
  const J z = everything(J::variable(x, 0), J::variable(y, 1));
  EXPECT_DOUBLE_EQ(z.value(), everything(x, y));
  const long double d = 1e-4L;
  const auto f = [](long double a, long double b) { return everything(a, b); };
  const auto close = [](double ad, long double fd) { EXPECT_NEAR(ad, static_cast<double>(fd), 2e-7); };
  close(z.gradient(0), (f(x + d, y) - f(x - d, y)) / (2 * d));
  close(z.gradient(1), (f(x, y + d) - f(x, y - d)) / (2 * d));
  close(z.hessian(0, 0), (f(x + d, y) - 2 * f(x, y) + f(x - d, y)) / (d * d));
  close(z.hessian(1, 1), (f(x, y + d) - 2 * f(x, y) + f(x, y - d)) / (d * d));
  close(z.hessian(0, 1),
        (f(x + d, y + d) - f(x + d, y - d) - f(x - d, y + d) + f(x - d, y - d)) / (4 * d * d));
  EXPECT_EQ(z.hessian(0, 1), z.hessian(1, 0));
}

TEST(Jet, FirstAndSecondOrderAgree) {
  const auto first = everything(Jet<2, 1>::variable(0.7, 0), Jet<2, 1>::variable(-0.4, 1));
  const auto second = everything(Jet<2, 2>::variable(0.7, 0), Jet<2, 2>::variable(-0.4, 1));
  EXPECT_DOUBLE_EQ(first.gradient(0), second.gradient(0));
  EXPECT_DOUBLE_EQ(first.gradient(1), second.gradient(1));
}

TEST(Jet, PowersWithSmallExponentsHaveFiniteDerivativesAtZero) {
  using J = Jet<1, 2>;
  const J zero = J::variable(0.0, 0);
  EXPECT_EQ(pow(zero, 0.0).gradient(0), 0.0);
  EXPECT_EQ(pow(zero, 1.0).gradient(0), 1.0);
  EXPECT_EQ(pow(zero, 1.0).hessian(0, 0), 0.0);
  EXPECT_EQ(pow(zero, 2.0).hessian(0, 0), 2.0);
}

TEST(Jet, AngleIsRightInEveryQuadrant) {
  for (const double angle : {0.3, 1.2, 2.0, 3.0, -0.5, -2.0, -3.0}) {
    using J = Jet<2, 2>;
    const double s = 2.0 * std::sin(angle), c = 2.0 * std::cos(angle);
    const J a = atan2(J::variable(s, 0), J::variable(c, 1));
    EXPECT_NEAR(a.value(), angle, 1e-15);
    EXPECT_NEAR(a.gradient(0), c / 4.0, 1e-15);
    EXPECT_NEAR(a.gradient(1), -s / 4.0, 1e-15);
    EXPECT_NEAR(a.hessian(0, 1), (s * s - c * c) / 16.0, 1e-14);
  }
}

TEST(Jet, DomainErrorsAreNaN) {
  using J = Jet<1, 1>;
  EXPECT_TRUE(std::isnan(sqrt(J::variable(-1.0, 0)).value()));
  EXPECT_TRUE(std::isnan(log(J::variable(-1.0, 0)).value()));
}

TEST(Dependence, TellsLinearQuadraticAndHigher) {
  using D = Dependence<3>;
  const D x = D::variable(0), y = D::variable(1), z = D::variable(2);
  const D linear = 2.0 * x - y / 3.0 + 1.0;
  const D quadratic = 0.5 * x * x + x * y;
  const D higher = quadratic * z + sin(x);
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) EXPECT_FALSE(linear.second_derivative(i, j));
  EXPECT_TRUE(quadratic.second_derivative(0, 0));
  EXPECT_TRUE(quadratic.second_derivative(1, 0));
  EXPECT_FALSE(quadratic.second_derivative(1, 1));
  EXPECT_FALSE(quadratic.second_derivative_varies(0, 1));
  EXPECT_TRUE(higher.second_derivative_varies(0, 0));
  EXPECT_TRUE(higher.second_derivative_varies(0, 1));  // z
  EXPECT_TRUE(higher.second_derivative_varies(2, 1));  // x
  EXPECT_FALSE(higher.second_derivative(2, 2));
  EXPECT_THROW((void)(x < y), D::Branches);
}

}  // namespace
}  // namespace diracstep
