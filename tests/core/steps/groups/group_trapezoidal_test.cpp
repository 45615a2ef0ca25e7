#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "differences.hpp"
#include "group_stepping.hpp"

namespace diracstep {
namespace {

/// The RATTLE-like step of Lie groups (Hante, Arnold 2021) of a top with x = R r, by hand: unknowns are the
/// velocity of the half step and λ⁺, then λ⁻ puts v1 on the rows.
struct Rattle {
  Eigen::Vector3d inertia{1.0, 1.7, 2.4}, arm{0.2, -0.1, 0.6};
  double mass = 1.2, gravity = 1.5;

  struct Point {
    Eigen::Matrix3d R;
    Eigen::Vector3d x;
    Eigen::Matrix<double, 6, 1> p;  // in the body, and m x'
  };
  static Eigen::Matrix3d hat(const Eigen::Vector3d& w) {
    return (Eigen::Matrix3d() << 0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0).finished();
  }
  static Eigen::Matrix3d exponential(const Eigen::Vector3d& w) {
    return Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix();
  }
  static Eigen::Matrix3d tangent(const Eigen::Vector3d& w) {
    const double a = w.norm();
    return Eigen::Matrix3d::Identity() - (1.0 - std::cos(a)) / (a * a) * hat(w) +
           (a - std::sin(a)) / (a * a * a) * hat(w) * hat(w);
  }
  Eigen::Matrix<double, 3, 6> rows(const Eigen::Matrix3d& R) const {
    Eigen::Matrix<double, 3, 6> b;
    b << R * hat(arm), Eigen::Matrix3d::Identity();
    return b;
  }
  Eigen::Matrix<double, 6, 1> force() const {
    return (Eigen::Matrix<double, 6, 1>() << 0, 0, 0, 0, 0, -mass * gravity).finished();
  }
  Eigen::Matrix<double, 6, 1> masses() const {
    return (Eigen::Matrix<double, 6, 1>() << inertia, mass, mass, mass).finished();
  }

  Point step(const Point& from, double h) const {
    Vector unknowns = Vector::Zero(9);
    unknowns.head(6) = from.p.cwiseQuotient(masses());
    const auto residual = [&](const Vector& y) {
      const Eigen::Vector3d w = y.head(3);
      Eigen::Matrix<double, 6, 1> half = masses().cwiseProduct(y.head(6));
      const Eigen::Matrix<double, 6, 1> known =
          from.p + 0.5 * h * force() - 0.5 * h * rows(from.R).transpose() * y.tail(3);
      half.head(3) -= tangent(-h * w).transpose() * known.head(3);
      half.tail(3) -= known.tail(3);
      Vector f(9);
      f << half, (from.x + h * y.segment(3, 3) - from.R * exponential(h * w) * arm) / h;
      return f;
    };
    for (int k = 0; k < 12; ++k)
      unknowns -= testing::difference_jacobian(residual, unknowns, 1e-6)
                      .partialPivLu()
                      .solve(residual(unknowns))
                      .eval();
    const Eigen::Vector3d w = unknowns.head(3);
    Point to{from.R * exponential(h * w), from.x + h * unknowns.segment(3, 3),
             masses().cwiseProduct(unknowns.head(6))};
    to.p.head(3) = tangent(h * w).transpose().partialPivLu().solve(to.p.head(3)).eval();
    to.p += 0.5 * h * force();
    const Eigen::Matrix<double, 3, 6> b = rows(to.R);
    const Eigen::Matrix<double, 6, 3> response = masses().cwiseInverse().asDiagonal() * b.transpose();
    const Eigen::Vector3d lambda = (b * response).partialPivLu().solve(b * to.p.cwiseQuotient(masses()));
    to.p -= b.transpose() * lambda;
    return to;
  }
};

TEST(GroupTrapezoidalStep, IsTheRattleOfLieGroups) {
  const Rattle rattle;
  const auto on = space(spaces::SO3{}, spaces::R<3>{});
  Vector q(7), v(6);
  q << group_scenes::generic_rotation(), 0.0, 0.0, 0.0;
  q = on->normalised(q);
  const Eigen::Matrix3d R = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  const Eigen::Vector3d w(0.6, -1.2, 1.4);
  q.tail(3) = R * rattle.arm;
  v << w, R * w.cross(rattle.arm);
  auto scene = group_scenes::scene_of(
      "top", on, lagrangian<7>([rattle]<class T>(const std::array<T, 7>& at, const std::array<T, 7>& u) {
        return 0.5 * (rattle.inertia[0] * u[0] * u[0] + rattle.inertia[1] * u[1] * u[1] +
                      rattle.inertia[2] * u[2] * u[2]) +
               0.5 * rattle.mass * (u[3] * u[3] + u[4] * u[4] + u[5] * u[5]) -
               rattle.mass * rattle.gravity * at[6];
      }),
      q, v);
  scene->constraints = {on_space(on, holonomic<7, 3>([rattle]<class T>(const std::array<T, 7>& at) {
                                   const auto M = group_scenes::matrix_of<7>(at);
                                   std::array<T, 3> phi;
                                   for (std::size_t i = 0; i < 3; ++i)
                                     phi[i] = at[4 + i] - (M[i][0] * rattle.arm[0] + M[i][1] * rattle.arm[1] +
                                                           M[i][2] * rattle.arm[2]);
                                   return phi;
                                 }))};
  const double h = 0.1;
  Rattle::Point point{R, q.tail(3),
                      (Eigen::Matrix<double, 6, 1>() << rattle.masses().cwiseProduct(v)).finished()};
  for (const Sample& sample : testing::samples_of(scene, {.method = "type1/trapezoidal", .step = h}, 20)) {
    const Eigen::Matrix3d here =
        Eigen::Quaterniond(sample.q[0], sample.q[1], sample.q[2], sample.q[3]).toRotationMatrix();
    EXPECT_LT((here - point.R).cwiseAbs().maxCoeff(), 2e-13) << sample.time;
    EXPECT_LT((sample.q.tail(3) - point.x).norm(), 2e-13) << sample.time;
    EXPECT_LT((sample.p - point.p).norm(), 1e-12) << sample.time;
    point = rattle.step(point, h);
  }
}

}  // namespace
}  // namespace diracstep
