#include <gtest/gtest.h>

#include <Eigen/LU>
#include <diracstep/core/system/scene.hpp>

#include "differences.hpp"
#include "group_stepping.hpp"
#include "misuse.hpp"

/// One-sided and trapezoidal discrete Lagrangians on groups, and generating functions of types 2 and 3 near
/// the diagonal.
namespace diracstep {
namespace {

using group_scenes::error_at;
using group_scenes::GroupScene;

std::vector<GroupScene> some_scenes() {
  return {group_scenes::heavy_top(), group_scenes::driven_top(), group_scenes::suslov(),
          group_scenes::top_with_rows(), group_scenes::body_on_spring()};
}

/// Errors of a one-sided step have terms of the next order that these steps do not make small.
TEST(TypesOnGroups, HaveTheirOrders) {
  for (const GroupScene& of : some_scenes()) {
    const Vector reference = group_scenes::reference(of, 1.0);
    const auto order = [&](const std::string& method, int steps) {
      return std::log2(error_at(of, reference, 1.0, steps, method) /
                       error_at(of, reference, 1.0, 2 * steps, method));
    };
    for (const char* method : {"type1/left", "type2/euler", "type3/euler"})
      EXPECT_NEAR(order(method, 200), 1.0, 0.2) << of.name << " " << method;
    for (const char* method : {"type2/legendre(type1/trapezoidal)", "type3/legendre(type1/midpoint)"})
      EXPECT_NEAR(order(method, 40), 2.0, 0.2) << of.name << " " << method;
  }
}

/// A Legendre transform near the diagonal steps as its discrete Lagrangian does, to the bit.
TEST(TypesOnGroups, StepAsTheirDiscreteLagrangian) {
  const auto end = [](const std::string& method) {
    return testing::samples_of(group_scenes::top_with_rows().scene, {.method = method, .step = 0.1}, 5)
        .back();
  };
  const auto expect_same = [&](const std::string& one, const std::string& other) {
    const Sample a = end(one), b = end(other);
    EXPECT_EQ(a.q, b.q) << one << " and " << other;
    EXPECT_EQ(a.v, b.v) << one << " and " << other;
  };
  for (const char* method : {"type2/euler", "type2/legendre(type1/left)", "type1/adjoint(type1/right)"})
    expect_same(method, "type1/left");
  for (const char* method : {"type3/euler", "type3/legendre(type1/right)", "type3/adjoint(type2/euler)"})
    expect_same(method, "type1/right");
  expect_same("type3/legendre(type1/trapezoidal)", "type1/trapezoidal");
  expect_same("type2/legendre(type1/midpoint)", "type1/gl:1");
}

/// A step of the one and a step back of the other lead to the start; on rows, up to the momentum that the
/// projection takes.
TEST(TypesOnGroups, TwoAndThreeAreEachOthersAdjoint) {
  for (const GroupScene& of : {group_scenes::heavy_top(), group_scenes::driven_top(),
                               group_scenes::body_on_spring(), group_scenes::top_with_rows()})
    for (const auto& [forth, back] :
         {std::pair{"type2/euler", "type3/euler"}, std::pair{"type1/right", "type1/left"}}) {
      Integrator there(of.scene, Registry::with_built_ins(), kinsol(), {.method = forth, .step = 0.2}),
          again(of.scene, Registry::with_built_ins(), kinsol(), {.method = back, .step = 0.2});
      Sample before, after;
      ASSERT_TRUE(there.sample(Momentum::projected, before).ok());
      ASSERT_TRUE(there.step().ok());
      again.restart(there.time(), there.position(), there.momentum(), before.v);
      ASSERT_TRUE(again.step(-0.2).ok());
      ASSERT_TRUE(again.sample(Momentum::projected, after).ok());
      EXPECT_LT((of.observe(before.q, before.v) - of.observe(after.q, after.v)).lpNorm<Eigen::Infinity>(),
                3e-14)
          << of.name << " " << forth;
    }
}

/// The generating functions of quadrature_step.hpp on a scene without rows, by Newton's method, and what
/// their differences say of a step that an integrator has taken.
class NearTheDiagonal {
 public:
  NearTheDiagonal(const Scene& scene, double w0, double h)
      : scene_(scene), space_(*scene.space), w0_(w0), h_(h) {}

  /// P·x − L_d, stationary in x: H_{d+} in the chart at g0 = g, H_{d−} in that at g1 = g.
  double value(const Vector& g, const Vector& P, bool at_end) const {
    const auto function = [&](const Vector& x) {
      const Vector v = x / h_, other = space_.moved(g, at_end ? Vector(-x) : x);
      const Vector &first = at_end ? other : g, &last = at_end ? g : other;
      return P.dot(x) - h_ * (w0_ * scene_.lagrangian->value(0.0, first, v) +
                              (1.0 - w0_) * scene_.lagrangian->value(h_, last, v));
    };
    Vector x = h_ * scene_.start.v;
    const auto gradient = [&](const Vector& at) { return gradient_of(function, at); };
    for (int k = 0; k < 4; ++k)
      x -= testing::difference_jacobian(gradient, x, 1e-4).partialPivLu().solve(gradient(x)).eval();
    return function(x);
  }

  /// A difference of order 4.
  template <class F>
  static Vector gradient_of(F function, const Vector& at) {
    constexpr double d = 1e-3;
    Vector out(at.size());
    for (Eigen::Index i = 0; i < at.size(); ++i) {
      const Vector e = Vector::Unit(at.size(), i);
      out[i] = (8.0 * (function(at + d * e) - function(at - d * e)) -
                (function(at + 2.0 * d * e) - function(at - 2.0 * d * e))) /
               (12.0 * d);
    }
    return out;
  }

  Vector by_momentum(const Vector& g, const Vector& P, bool at_end) const {
    return gradient_of([&](const Vector& y) { return value(g, y, at_end); }, P);
  }
  Vector by_place(const Vector& g, const Vector& P, bool at_end) const {
    return gradient_of([&](const Vector& y) { return value(space_.moved(g, y), P, at_end); },
                       Vector(Vector::Zero(P.size())));
  }

 private:
  const Scene& scene_;
  const Space& space_;
  double w0_, h_;
};

TEST(TypesOnGroups, GeneratingFunctionsNearTheDiagonalGenerateTheStep) {
  const GroupScene top = group_scenes::heavy_top();
  const Space& space = *top.scene->space;
  const double h = 0.2;
  for (const auto& [rule, w0] :
       {std::pair{"left", 1.0}, std::pair{"right", 0.0}, std::pair{"trapezoidal", 0.5}}) {
    Integrator integrator(top.scene, Registry::with_built_ins(), kinsol(),
                          {.method = std::string("type1/") + rule, .step = h});
    const Vector g0 = integrator.position(), p0 = integrator.momentum();
    ASSERT_TRUE(integrator.step().ok());
    const Vector g1 = integrator.position(), p1 = integrator.momentum(), x = space.difference(g0, g1);
    Columns adjoint(3, 3), adjoint_back(3, 3), dtau(3, 3), back(3, 3);
    space.maps(x, adjoint, adjoint_back, dtau, back);
    const NearTheDiagonal s(*top.scene, w0, h);
    const Vector P1 = dtau.transpose() * p1, P0 = back.transpose() * p0;
    EXPECT_LT((s.by_momentum(g0, P1, false) - x).norm(), 1e-9) << rule;
    EXPECT_LT((back.transpose().partialPivLu().solve(P1) + s.by_place(g0, P1, false) - p0).norm(), 1e-9)
        << rule;
    EXPECT_LT((s.by_momentum(g1, P0, true) - x).norm(), 1e-9) << rule;
    EXPECT_LT((dtau.transpose().partialPivLu().solve(P0) - s.by_place(g1, P0, true) - p1).norm(), 1e-9)
        << rule;
  }
}

/// A body without inertia about its third axis has no equation for that rate, but where a row gives it.
TEST(TypesOnGroups, VelocitiesWithoutMassAreRefusedByName) {
  const Eigen::Matrix3d rod = Eigen::Vector3d(1.0, 2.0, 0.0).asDiagonal();
  const auto scene = group_scenes::free_body(rod, (Vector(3) << 0.8, -1.3, 0.0).finished());
  for (const char* method : {"type1/gl:2", "type1/midpoint", "type1/trapezoidal", "type2/euler"})
    testing::expect_misuse(
        [&] { Integrator(scene, Registry::with_built_ins(), kinsol(), {.method = method, .step = 0.1}); },
        {"on SO3", "no mass along velocities of w2", "R^n only"});
  auto held = std::make_shared<Scene>(*scene);
  held->constraints = {on_space(scene->space, pfaffian<4, 1>([]<class T>(const std::array<T, 4>&) {
                                  return std::array<std::array<T, 4>, 1>{{{T(0.0), T(0.0), T(1.0), T(0.0)}}};
                                }))};
  const Sample end = testing::samples_of(held, {.method = "type1/gl:2", .step = 0.1}, 10).back();
  EXPECT_NEAR(end.v[0], 0.8, 1e-13);  // ω₁' = ω₂' = 0 with ω₃ = 0
  EXPECT_NEAR(end.v[1], -1.3, 1e-13);
}

}  // namespace
}  // namespace diracstep
