#include <gtest/gtest.h>

#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/legendre_transform.hpp>
#include <diracstep/core/system/phase_function.hpp>

#include "differences.hpp"
#include "scenes.hpp"

namespace diracstep {
namespace {

using testing::difference_jacobian;
using testing::full;

struct Driven {
  template <class T>
  T operator()(const std::array<T, 2>& q, const std::array<T, 2>& v, const T& t) const {
    using std::cos, std::sin;
    return 0.5 * (1.0 + 0.3 * sin(t)) * v[0] * v[0] + v[1] * v[1] * (1.0 + q[0] * q[0]) -
           cos(q[0] * q[1]) * t;
  }
};

Vector column(std::initializer_list<double> entries) {
  Vector v(static_cast<Eigen::Index>(entries.size()));
  std::copy(entries.begin(), entries.end(), v.begin());
  return v;
}

void expect_derivatives_agree(const PhaseFunction& f, double t, const Vector& x, const Vector& y) {
  const Eigen::Index n = x.size(), nonzeros = f.pattern().nonzeros();
  Vector fx(n), fy(n), fxx(nonzeros), fxy(nonzeros), fyy(nonzeros), fyt(n);
  f.gradient(t, x, y, fx, fy);
  f.hessian(t, x, y, fxx, fxy, fyy);
  f.gradient_rate(t, x, y, fyt);
  const auto value = [&](const Vector& a, const Vector& b) { return Vector::Constant(1, f.value(t, a, b)); };
  const auto gradient = [&](double time, const Vector& a, const Vector& b) {
    Vector g(2 * n), gx(n), gy(n);
    f.gradient(time, a, b, gx, gy);
    g << gx, gy;
    return g;
  };
  const auto close = [](const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
    EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-8);
  };
  close(fx.transpose(), difference_jacobian([&](const Vector& a) { return value(a, y); }, x));
  close(fy.transpose(), difference_jacobian([&](const Vector& b) { return value(x, b); }, y));
  const Eigen::MatrixXd by_x = difference_jacobian([&](const Vector& a) { return gradient(t, a, y); }, x);
  const Eigen::MatrixXd by_y = difference_jacobian([&](const Vector& b) { return gradient(t, x, b); }, y);
  close(full(f.pattern(), fxx), by_x.topRows(n));
  close(full(f.pattern(), fxy), by_y.topRows(n));
  close(full(f.pattern(), fxy).transpose(), by_x.bottomRows(n));
  close(full(f.pattern(), fyy), by_y.bottomRows(n));
  const auto rate = [&](const Vector& time) { return Vector(gradient(time[0], x, y).tail(n)); };
  close(fyt, difference_jacobian(rate, Vector::Constant(1, t)));
}

TEST(PhaseFunction, FormulaDerivativesAgreeWithDifferences) {
  expect_derivatives_agree(*lagrangian<3>(testing::Particle{}), 0.0, column({0.4, -0.2, 0.9}),
                           column({0.3, 0.8, -0.5}));
  expect_derivatives_agree(*lagrangian<2>(Driven{}), 0.7, column({0.4, -0.2}), column({0.3, 0.8}));
}

TEST(PhaseFunction, LegendreTransformHasExactDerivativesAndIsAnInvolution) {
  const auto l = lagrangian<2>(Driven{});
  const Vector q = column({0.4, -0.2}), v = column({0.3, 0.8});
  const auto h = hamiltonian_from(l, 0.7, q, v);
  expect_derivatives_agree(*h, 0.7, q, v);
  const auto back = lagrangian_from(h, 0.7, q, v);
  EXPECT_NEAR(back->value(0.7, q, v), l->value(0.7, q, v), 1e-14);
}

TEST(PhaseFunction, DegenerateFunctionsHaveNoTransform) {
  const auto degenerate =
      lagrangian<2>([](const auto& q, const auto& v) { return q[0] * v[1] - q[1] * q[1]; });
  EXPECT_THROW((void)hamiltonian_from(degenerate, 0.0, column({1.0, 1.0}), column({0.0, 0.0})), Misuse);
}

TEST(PhaseFunction, StructureIsFoundFromTheFormula) {
  const auto separable = lagrangian<2>(
      [](const auto& q, const auto& v) { return v[0] * v[0] + 2.0 * v[1] * v[1] - q[0] * q[0] * q[1]; });
  EXPECT_TRUE(separable->structure().separable);
  EXPECT_TRUE(separable->structure().y_hessian_constant);
  EXPECT_TRUE(separable->structure().y_hessian_diagonal);
  EXPECT_FALSE(separable->structure().quadratic);
  const auto coupled = lagrangian<2>([](const auto& q, const auto& v) { return v[0] * v[1] + q[0] * v[1]; });
  EXPECT_FALSE(coupled->structure().separable);
  EXPECT_TRUE(coupled->structure().y_hessian_constant);
  EXPECT_FALSE(coupled->structure().y_hessian_diagonal);
  EXPECT_TRUE(coupled->structure().quadratic);
  EXPECT_FALSE(lagrangian<3>(testing::Particle{})->structure().y_hessian_constant);
  EXPECT_FALSE(lagrangian<2>(Driven{})->structure().y_hessian_constant);
  const auto branching = lagrangian<1>(
      [](const auto& q, const auto& v) { return q[0] > 0.0 ? v[0] * v[0] - q[0] * q[0] : v[0] * v[0]; });
  EXPECT_FALSE(branching->structure().separable);
}

}  // namespace
}  // namespace diracstep
