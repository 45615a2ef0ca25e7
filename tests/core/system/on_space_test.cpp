#include <gtest/gtest.h>

#include <diracstep/core/system/saddle_point.hpp>

#include "differences.hpp"
#include "group_scenes.hpp"
#include "misuse.hpp"

namespace diracstep {
namespace {

using testing::difference_jacobian;
using testing::full;

/// Derivatives along the space, by differences of q τ(x) at x = 0.
class OnSpace : public ::testing::TestWithParam<group_scenes::GroupScene> {
 protected:
  const Scene& scene() const { return *GetParam().scene; }
  Vector near_start(const Vector& x) const { return scene().space->moved(scene().start.q, x); }
  int n() const { return scene().dimension(); }
  Vector zero() const { return Vector::Zero(n()); }
  Vector a_velocity() const {
    Vector v = scene().start.v;
    for (Eigen::Index i = 0; i < v.size(); ++i) v[i] += 0.3 * std::cos(1.0 + static_cast<double>(i));
    return v;
  }
};

TEST_P(OnSpace, DerivativesOfTheLagrangianAgreeWithDifferences) {
  const Lagrangian& l = *scene().lagrangian;
  const Vector v = a_velocity();
  Vector fx(n()), fy(n()), xx(n() * n()), xy(xx), yy(xx);
  l.gradient(0.0, scene().start.q, v, fx, fy);
  l.hessian(0.0, scene().start.q, v, xx, xy, yy);
  const auto gradient_at = [&](const Vector& x, const Vector& u, bool by_x) {
    Vector a(n()), b(n());
    l.gradient(0.0, near_start(x), u, a, b);
    return by_x ? a : b;
  };
  const auto value = [&](const Vector& x) {
    return Vector(Vector::Constant(1, l.value(0.0, near_start(x), v)));
  };
  EXPECT_LT((difference_jacobian(value, zero()).transpose() - fx).cwiseAbs().maxCoeff(), 1e-8);
  const auto along = [&](const Vector& x) { return gradient_at(x, v, true); };
  EXPECT_LT((difference_jacobian(along, zero()) - full(l.pattern(), xx)).cwiseAbs().maxCoeff(), 1e-8);
  const auto momentum = [&](const Vector& x) { return gradient_at(x, v, false); };
  EXPECT_LT((difference_jacobian(momentum, zero()).transpose() - full(l.pattern(), xy)).cwiseAbs().maxCoeff(),
            1e-8);
  const auto by_velocity = [&](const Vector& u) { return gradient_at(zero(), u, false); };
  EXPECT_LT((difference_jacobian(by_velocity, v) - full(l.pattern(), yy)).cwiseAbs().maxCoeff(), 1e-8);
}

TEST_P(OnSpace, DerivativesOfTheRowsAgreeWithDifferences) {
  const Vector w = a_velocity();
  for (const auto& block : scene().constraints) {
    const int m = block->rows();
    Vector values(block->pattern().nonzeros()), b(m), d(values), lambda(m),
        k(block->curvature_pattern().nonzeros());
    for (int r = 0; r < m; ++r) lambda[r] = 0.7 - 0.4 * r;
    const auto forms = [&](const Vector& x) {
      Vector a(values.size()), unused(m);
      block->coefficients(0.0, near_start(x), a, unused);
      return full(block->pattern(), a);
    };
    const auto rates = [&](const Vector& x) { return Vector(forms(x) * w); };
    const auto impulse = [&](const Vector& x) { return Vector(forms(x).transpose() * lambda); };
    block->derivative(0.0, scene().start.q, w, 1.0, d);
    EXPECT_LT((difference_jacobian(rates, zero()) - full(block->pattern(), d)).cwiseAbs().maxCoeff(), 1e-8);
    block->annihilator_derivative(0.0, scene().start.q, lambda, k);
    EXPECT_LT(
        (difference_jacobian(impulse, zero()) - full(block->curvature_pattern(), k)).cwiseAbs().maxCoeff(),
        1e-8);
    if (!block->holonomic()) continue;
    const auto phi = [&](const Vector& x) {
      Vector out(m);
      block->position(0.0, near_start(x), out);
      return out;
    };
    EXPECT_LT((difference_jacobian(phi, zero()) - forms(zero())).cwiseAbs().maxCoeff(), 1e-8);
  }
}

/// The acceleration of Scene's equation on a space against that of Newton and Euler, written by hand.
TEST_P(OnSpace, AccelerationIsThatOfNewtonAndEuler) {
  const Start& start = scene().start;
  AccelerationProblem problem(scene(), true);
  problem.begin(0.0, start.q, start.v);
  Vector x = Vector::Zero(problem.size()), f(problem.size()), values(problem.pattern().nonzeros());
  problem.residual(x, f);
  problem.jacobian(x, values);
  x = -full(problem.pattern(), values).partialPivLu().solve(f);
  const Vector here = GetParam().observe(start.q, start.v);
  const group_scenes::Column rates = GetParam().rates(group_scenes::Column(here.begin(), here.end()));
  // q τ(h v + …) and v + h a, differentiated
  const double h = 1e-5;
  const auto moved = [&](double t) -> Vector {
    return GetParam().observe(scene().space->moved(start.q, t * start.v), start.v + t * x.head(n()));
  };
  const Vector by_difference = (moved(h) - moved(-h)) / (2.0 * h);
  for (Eigen::Index i = 0; i < here.size(); ++i)
    EXPECT_NEAR(by_difference[i], static_cast<double>(rates[static_cast<std::size_t>(i)]), 2e-9) << i;
}

INSTANTIATE_TEST_SUITE_P(Scenes, OnSpace, ::testing::ValuesIn(group_scenes::all_scenes()),
                         [](const auto& of) {
                           std::string name = of.param.name;
                           std::erase(name, ' ');
                           return name;
                         });

TEST(SceneOnSpace, IsRefusedWhereItDoesNotFit) {
  const auto on = group_scenes::rotations();
  testing::expect_misuse(
      [&] { (void)on_space(on, lagrangian<3>([](const auto&, const auto& v) { return v[0] * v[0]; })); },
      {"a Lagrangian on SO3", "3", "4"});
  Scene scene = *group_scenes::heavy_top().scene;
  scene.start.q *= 1.01;
  testing::expect_misuse([&] { require_consistent(scene, scene.start); }, {"not on SO3", "length 1"});
  Scene with_h = *group_scenes::heavy_top().scene;
  with_h.hamiltonian = hamiltonian<3>([](const auto&, const auto& p) { return p[0] * p[0]; });
  testing::expect_misuse([&] { require_well_formed(with_h); }, {"by a Lagrangian, and by that alone"});
}

}  // namespace
}  // namespace diracstep
