#include <gtest/gtest.h>

#include <diracstep/scene_format/scene_catalogue.hpp>
#include <random>

namespace diracstep {
namespace {

/// So many points are more than a scene file evaluates at once; so few are not.
class PointsAtOnce : public ::testing::TestWithParam<int> {
 protected:
  PointColumns at(const Scene& scene) {
    const Eigen::Index n = scene.dimension();
    std::mt19937 random(3);
    std::uniform_real_distribution<double> part(-0.1, 0.1);
    x_ = scene.start.q.replicate(1, GetParam());
    y_ = scene.start.v.replicate(1, GetParam());
    for (Columns* columns : {&x_, &y_})
      for (double& entry : columns->reshaped()) entry += part(random);
    times_ = Vector::LinSpaced(GetParam(), 0.0, 1.0);
    EXPECT_EQ(x_.rows(), n);
    return {GetParam(), times_.data(), x_.data(), y_.data()};
  }
  Columns x_, y_;
  Vector times_;
};

TEST_P(PointsAtOnce, GiveTheBitsOfThePointsOneByOne) {
  for (const std::string& name : scene_names()) {
    const CatalogueScene entry = make_scene(name);
    const Scene& scene = *entry.scene;
    if (scene.space) continue;  // configurations have more numbers than velocities: no columns of both
    const PointColumns points = at(scene);
    const int n = scene.dimension(), count = points.count;
    if (scene.lagrangian) {
      const Lagrangian& l = *scene.lagrangian;
      Columns fx(n, count), fy = fx, gx = fx, gy = fx;
      l.gradients(points, fx.data(), fy.data());
      l.PhaseFunction::gradients(points, gx.data(), gy.data());
      EXPECT_EQ(fx, gx) << name;
      EXPECT_EQ(fy, gy) << name;
      Columns xx(l.pattern().nonzeros(), count), xy = xx, yy = xx, rxx = xx, rxy = xx, ryy = xx;
      l.hessians(points, xx.data(), xy.data(), yy.data());
      l.PhaseFunction::hessians(points, rxx.data(), rxy.data(), ryy.data());
      EXPECT_EQ(xx, rxx) << name;
      EXPECT_EQ(xy, rxy) << name;
      EXPECT_EQ(yy, ryy) << name;
    }
    for (const auto& rows : scene.constraints) {
      const int m = rows->rows();
      Columns a(rows->pattern().nonzeros(), count), b(m, count), a1 = a, b1 = b, d = a, d1 = a, phi = b,
                                                                 phi1 = b;
      Columns curvature(rows->curvature_pattern().nonzeros(), count), curvature1 = curvature;
      const Columns lambda = Columns::Constant(m, count, 0.7) + Columns::Identity(m, count);
      rows->coefficients_at(points, a.data(), b.data());
      rows->ConstraintRows::coefficients_at(points, a1.data(), b1.data());
      EXPECT_EQ(a, a1) << name;
      EXPECT_EQ(b, b1) << name;
      rows->derivatives(points, d.data());
      rows->ConstraintRows::derivatives(points, d1.data());
      EXPECT_EQ(d, d1) << name;
      rows->annihilator_derivatives(points, lambda.data(), curvature.data());
      rows->ConstraintRows::annihilator_derivatives(points, lambda.data(), curvature1.data());
      EXPECT_EQ(curvature, curvature1) << name;
      if (!rows->holonomic()) continue;
      rows->positions(points, phi.data());
      rows->ConstraintRows::positions(points, phi1.data());
      EXPECT_EQ(phi, phi1) << name;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(FewAndMany, PointsAtOnce, ::testing::Values(1, 7, 8, 9));

}  // namespace
}  // namespace diracstep
