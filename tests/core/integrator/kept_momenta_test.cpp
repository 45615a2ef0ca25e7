#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/kept_momenta.hpp>

#include "group_scenes.hpp"
#include "group_stepping.hpp"
#include "scenes.hpp"

namespace diracstep {
namespace {

using Names = std::vector<std::string>;

/// L = (v² + u² + w²)/2 − g y, where q4 has a potential that is nowhere but at one point without a slope.
Scene flight() {
  Scene scene;
  scene.name = "flight";
  scene.coordinates = {"x", "y", "z", "s"};
  scene.lagrangian = lagrangian<4>([](const auto& q, const auto& v) {
    using std::cos;
    return 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3]) - 9.81 * q[1] + cos(q[3]);
  });
  scene.start = {0.0, Vector::Zero(4), Vector::Zero(4)};
  return scene;
}

TEST(KeptMomenta, AreThoseOfCoordinatesThatNothingActsAlong) {
  Scene scene = flight();
  EXPECT_EQ(kept_momenta(scene), (Names{"x", "z"}));  // at the start the slope along s is zero as well
  scene.force = force<4>([]<class T>(const std::array<T, 4>&, const std::array<T, 4>& v) {
    return std::array<T, 4>{-0.1 * v[0], T(0.0), T(0.0), T(0.0)};
  });
  EXPECT_EQ(kept_momenta(scene), (Names{"z"}));
  scene.constraints = {
      holonomic<4, 1>([]<class T>(const std::array<T, 4>& q) { return std::array<T, 1>{q[1] - q[2]}; })};
  EXPECT_EQ(kept_momenta(scene), Names{});
}

TEST(KeptMomenta, OnGroupsAreThoseAboutAxesOfSpace) {
  // gravity along e3, and K makes no difference: L sees R by the third row alone
  EXPECT_EQ(kept_momenta(*group_scenes::heavy_top().scene), (Names{"w2"}));
  EXPECT_EQ(kept_momenta(*group_scenes::free_body(Eigen::Vector3d(1.0, 2.0, 3.0).asDiagonal(),
                                                  (Vector(3) << 1.0, 0.5, -0.2).finished())),
            (Names{"w0", "w1", "w2"}));
  EXPECT_EQ(kept_momenta(*group_scenes::suslov().scene), Names{});  // a row of the body acts about every axis
}

/// What is named is kept by a run, what is not is not.
TEST(KeptMomenta, AreKeptByARun) {
  const auto scene = group_scenes::heavy_top().scene;
  const auto in_space = [&](const Sample& at) {
    const auto R = spaces::rotation_matrix(at.q[0], at.q[1], at.q[2], at.q[3]);
    Vector momentum(3);
    for (std::size_t i = 0; i < 3; ++i)
      momentum[static_cast<Eigen::Index>(i)] = R[i][0] * at.p[0] + R[i][1] * at.p[1] + R[i][2] * at.p[2];
    return momentum;
  };
  const auto samples = testing::samples_of(scene, {.method = "type1/gl:2", .step = 0.1}, 20,
                                           Momentum::projected, Registry::with_built_ins(), 20);
  const Vector change = (in_space(samples.back()) - in_space(samples.front())).cwiseAbs();
  const Names kept = kept_momenta(*scene);
  for (std::size_t i = 0; i < 3; ++i) {
    const double moved = change[static_cast<Eigen::Index>(i)];
    if (std::ranges::find(kept, scene->coordinates[i]) != kept.end()) {
      EXPECT_LT(moved, 1e-12);
    } else {
      EXPECT_GT(moved, 1e-3);
    }
  }
}

}  // namespace
}  // namespace diracstep
