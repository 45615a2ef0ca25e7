#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/scene_format/scene_file.hpp>
#include <filesystem>
#include <fstream>
#include <map>

#include "stepping.hpp"

/// The scenes of the catalogue that are made of bodies, beside their references.
namespace diracstep::body_scene_tests {
namespace {

double output_of(const CatalogueScene& entry, const Sample& sample, const std::string& name) {
  const auto found = std::ranges::find(entry.outputs, name, &Output::name);
  if (found == entry.outputs.end()) throw std::logic_error("no output " + name);
  return found->at(sample.point());
}

/// Lines without those that are empty or a comment, and without references.
int lines_of_scene(const std::filesystem::path& path) {
  std::ifstream file(path);
  int lines = 0;
  bool counted = true;
  for (std::string line; std::getline(file, line);) {
    const std::size_t first = line.find_first_not_of(' ');
    if (first == std::string::npos || line[first] == '#') continue;
    if (line[0] == '[') counted = line != "[[reference]]" && line != "[recommended]";
    if (counted) ++lines;
  }
  return lines;
}

TEST(BodyScenes, HaveTwentyLinesAtMost) {
  int bodies = 0;
  for (const std::string& name : scene_names()) {
    if (make_scene(name).bodies.empty()) continue;
    ++bodies;
    EXPECT_LE(lines_of_scene(std::filesystem::path(DIRACSTEP_SCENES) / (name + ".toml")), 20) << name;
  }
  EXPECT_EQ(bodies, 9);
}

/// The heavy top at t = 1 by its rate as well, with an error that falls by 2^6 when the step is halved.
TEST(BodyScenes, TheTopTurnsAtTheRateOfBruelsAndCardona) {
  const CatalogueScene top = make_scene("spinning_top");
  const auto rate = [&](const Sample& end) {  // 2 conj(q) q'
    const auto q = end.q.tail<4>(), v = end.v.tail<4>();
    return std::array{2.0 * (q[0] * v[1] - q[1] * v[0] - q[2] * v[3] + q[3] * v[2]),
                      2.0 * (q[0] * v[2] - q[2] * v[0] - q[3] * v[1] + q[1] * v[3]),
                      2.0 * (q[0] * v[3] - q[3] * v[0] - q[1] * v[2] + q[2] * v[1])};
  };
  const std::array<double, 3> known{-0.8220781017, 150.0, -5.923291348};
  const std::array<double, 3> place{0.17334396410, 0.64008859207, -0.74849079113};
  const auto error = [&](double step) {
    const Sample end = testing::end_of(top.scene, 1.0, step, "type1/gl:3");
    const auto w = rate(end);
    double off = 0.0;
    for (std::size_t k = 0; k < 3; ++k)
      off = std::max(
          {off, std::abs(w[k] - known[k]), std::abs(end.q[static_cast<Eigen::Index>(k)] - place[k])});
    return off;
  };
  const double coarse = error(0.002), fine = error(0.001);
  EXPECT_LT(fine, 5e-8);
  EXPECT_NEAR(std::log2(coarse / fine), 6.0, 0.5) << coarse << ' ' << fine;
}

/// q' of M q'' + v C1 q' + (g K0 + v² K2) q = 0 for the lean and the steer of the benchmark bicycle:
/// Meijaard, Papadopoulos, Ruina, Schwab (2007), appendix A.
class LinearBicycle {
 public:
  explicit LinearBicycle(double speed) {
    Eigen::Matrix2d m, c1, k0, k2;
    m << 80.81722, 2.31941332208709, 2.31941332208709, 0.29784188199686;
    c1 << 0.0, 33.86641391492494, -0.85035641456978, 1.68540397397560;
    k0 << -80.95, -2.59951685249872, -2.59951685249872, -0.80329488458618;
    k2 << 0.0, 76.59734589573222, 0.0, 2.65431523794604;
    system_.setZero();
    system_.topRightCorner<2, 2>().setIdentity();
    system_.bottomLeftCorner<2, 2>() = -m.inverse() * (9.81 * k0 + speed * speed * k2);
    system_.bottomRightCorner<2, 2>() = -speed * (m.inverse() * c1);
  }
  /// By Runge and Kutta's method.
  Eigen::Vector4d at(double t, Eigen::Vector4d state) const {
    constexpr int steps = 4000;
    const double h = t / steps;
    for (int k = 0; k < steps; ++k) {
      const Eigen::Vector4d a = system_ * state, b = system_ * (state + 0.5 * h * a),
                            c = system_ * (state + 0.5 * h * b), d = system_ * (state + h * c);
      state += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
    }
    return state;
  }
  const Eigen::Matrix4d& system() const { return system_; }

 private:
  Eigen::Matrix4d system_;
};

/// The published eigenvalues at 5 m/s make the characteristic polynomial vanish: the matrices are those of
/// the paper.
TEST(BodyScenes, TheLinearBicycleHasThePublishedEigenvalues) {
  const Eigen::Matrix4d a = LinearBicycle(5.0).system();
  for (const double real : {-0.32286642900409, -14.07838969279822}) {
    const Eigen::Matrix4d shifted = a - real * Eigen::Matrix4d::Identity();
    EXPECT_LT(std::abs(shifted.determinant()), 1e-8) << real;
  }
  const double weave = -0.77534188219585, frequency = 4.46486771378823;
  const Eigen::Matrix4d shifted = a - weave * Eigen::Matrix4d::Identity();
  EXPECT_LT(std::abs((shifted * shifted + frequency * frequency * Eigen::Matrix4d::Identity()).determinant()),
            1e-8);
}

TEST(BodyScenes, SmallMotionsOfTheBicycleAreThoseOfTheBenchmark) {
  const LinearBicycle linear(5.0);
  for (const double push : {1e-4, 1e-2}) {
    const CatalogueScene bicycle = make_scene("bicycle", {{"push", push}});
    for (const double t : {0.5, 1.0, 2.0}) {
      const Sample end = testing::end_of(bicycle.scene, t, 0.02, "type1/gl:4");
      const Eigen::Vector4d expected = linear.at(t, {0.0, 0.0, push, 0.0});
      EXPECT_NEAR(output_of(bicycle, end, "lean") / push, expected[0] / push, 1e-8 + 10.0 * push * push) << t;
      EXPECT_NEAR(output_of(bicycle, end, "steer_turned") / push, expected[1] / push,
                  1e-8 + 10.0 * push * push)
          << t;
    }
  }
}

/// Chaplygin's ball keeps its energy and, in space, its moment of momentum about the point of contact.
TEST(BodyScenes, ChaplyginsBallKeepsItsMoment) {
  const CatalogueScene ball = make_scene("chaplygin_ball");
  const auto moment = [](const Sample& s) {
    const Eigen::Quaterniond q(s.q[3], s.q[4], s.q[5], s.q[6]), v(s.v[3], s.v[4], s.v[5], s.v[6]);
    const Eigen::Vector3d w = 2.0 * (q.conjugate() * v).vec();  // in the ball
    const Eigen::Vector3d spin = q * Eigen::Vector3d(0.02 * w[0], 0.03 * w[1], 0.04 * w[2]);
    const Eigen::Vector3d arm(0.0, 0.0, 0.25), momentum = 1.5 * s.v.head<3>();
    return Eigen::Vector3d(spin + arm.cross(momentum));
  };
  const auto samples = testing::samples_of(ball.scene, {.method = "type1/gl:4", .step = 0.05}, 100);
  EXPECT_LT((moment(samples.back()) - moment(samples.front())).norm(), 1e-10);
  EXPECT_LT(std::abs(samples.back().energy - samples.front().energy), 1e-10);
}

TEST(BodyScenes, TheFiveBarLeavesThreeRowsOut) {
  const CatalogueScene linkage = make_scene("five_bar");
  EXPECT_EQ(linkage.scene->dimension() - linkage.scene->rows(), 2);
  ASSERT_FALSE(linkage.changes.empty());
  EXPECT_NE(linkage.changes.back().find("redundant constraints left out"), std::string::npos);
}

}  // namespace
}  // namespace diracstep::body_scene_tests
