#include <gtest/gtest.h>

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "scenes.hpp"

namespace diracstep {
namespace {

/// Masses on springs with one or two constant rows: everything is linear.
std::shared_ptr<const Scene> linear_scene(const ConstraintBlocks& rows) {
  Scene scene;
  scene.name = "linear";
  scene.coordinates = {"x", "y", "z"};
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (v[0] * v[0] + 2.0 * v[1] * v[1] + v[2] * v[2]) + 0.2 * v[0] * v[1] - 0.3 * v[0] * q[1] -
           0.5 * (q[0] * q[0] + 3.0 * q[1] * q[1]) - q[0] * q[2];
  });
  scene.constraints = rows;
  scene.start = {0.0, Vector{{0.5, 1.0, -0.5}}, Vector{{0.3, 0.0, -0.3}}};
  return std::make_shared<const Scene>(scene);
}

struct Flat {
  template <class T>
  std::array<std::array<T, 3>, 1> operator()(const std::array<T, 3>&) const {
    return {{{T(1.0), T(0.0), T(1.0)}}};
  }
};
struct Plane {
  template <class T>
  std::array<T, 1> operator()(const std::array<T, 3>& q) const {
    return {q[0] + q[2]};
  }
};

Work work_of(const std::shared_ptr<const Scene>& scene, const IntegratorOptions& options,
             const KinsolOptions& solver = {}) {
  Integrator integrator(scene, Registry::with_built_ins(), kinsol(solver), options);
  for (int k = 0; k < 200; ++k) EXPECT_TRUE(integrator.step().ok());
  return integrator.work();
}

TEST(ConstantJacobian, QuadraticLagrangianWithConstantRowsFactorsOnceForARun) {
  const std::vector<ConstraintBlocks> rows{{}, {pfaffian<3, 1>(Flat{})}, {holonomic<3, 1>(Plane{})}};
  for (const ConstraintBlocks& blocks : rows)
    for (const int limit : {40, 0}) {
      const auto scene = linear_scene(blocks);
      for (const char* method : {"type1/midpoint", "type1/gl:2", "type1/gl:4"})
        EXPECT_EQ(work_of(scene, {.method = method, .step = 0.1, .dense_limit = limit}).jacobian_evaluations,
                  1)
            << method;
      // Suzuki's composition has two different fractions.
      EXPECT_EQ(work_of(scene, {.method = "type1/midpoint", .order = 4, .step = 0.1, .dense_limit = limit})
                    .jacobian_evaluations,
                2);
    }
}

TEST(ConstantJacobian, IsNotSeenWhereSomethingVaries) {
  EXPECT_TRUE((pfaffian<3, 1>(Flat{})->constant()));
  EXPECT_TRUE((holonomic<3, 1>(Plane{})->constant()));
  for (const auto& scene : testing::every_constraint_class())
    EXPECT_GT(work_of(scene, {.method = "type1/midpoint", .step = 0.05}).jacobian_evaluations, 100)
        << scene->name;
  const auto moving = pfaffian<3, 1>([]<class T>(const std::array<T, 3>&, const T& t) {
    return std::array<std::array<T, 3>, 1>{{{T(1.0), t, T(1.0)}}};
  });
  EXPECT_FALSE(moving->constant());
  const auto pushed = affine<3, 1>(
      Flat{}, []<class T>(const std::array<T, 3>&, const T& t) { return std::array<T, 1>{t * t}; });
  EXPECT_TRUE(pushed->constant());
  const auto bent =
      affine<3, 1>(Flat{}, []<class T>(const std::array<T, 3>& q) { return std::array<T, 1>{0.1 * q[1]}; });
  EXPECT_FALSE(bent->constant());
  const auto turning = holonomic<3, 1>(
      []<class T>(const std::array<T, 3>& q, const T& t) { return std::array<T, 1>{q[0] + t * q[2]}; });
  EXPECT_FALSE(turning->constant());
}

TEST(FixedPoint, StepsAreThoseOfNewtonsMethod) {
  for (const auto& scene : testing::every_constraint_class())
    for (const char* method : {"type1/midpoint", "type1/gl:3", "type1/gl:5"}) {
      const IntegratorOptions options{.method = method, .step = 0.05};
      Integrator newton(scene, Registry::with_built_ins(), kinsol({.jacobian = JacobianPolicy::fresh}),
                        options);
      Integrator fixed_point(scene, Registry::with_built_ins(), kinsol({.iteration = Iteration::fixed_point}),
                             options);
      for (int k = 0; k < 100; ++k) {
        ASSERT_TRUE(newton.step().ok());
        ASSERT_TRUE(fixed_point.step().ok());
      }
      EXPECT_LT((newton.position() - fixed_point.position()).lpNorm<Eigen::Infinity>(), 2e-12)
          << scene->name << " " << method;
      EXPECT_EQ(fixed_point.work().jacobian_evaluations, 0) << scene->name << " " << method;
      EXPECT_GT(fixed_point.work().iterations, newton.work().iterations);
    }
}

}  // namespace
}  // namespace diracstep
