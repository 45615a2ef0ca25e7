#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <diracstep/core/steps/groups/step.hpp>

#include "group_stepping.hpp"
#include "methods.hpp"

namespace diracstep {
namespace {

using group_scenes::error_at;
using group_scenes::free_body;
using group_scenes::GroupScene;
using testing::gl;

/// Jacobi's sn, cn, dn of u with parameter m, by descending Landen transformations.
std::array<double, 3> jacobi(double u, double m) {
  std::array<double, 20> a{1.0}, c{std::sqrt(m)};
  double b = std::sqrt(1.0 - m);
  std::size_t n = 0;
  while (std::abs(c[n]) > 1e-17 && n + 1 < a.size()) {
    a[n + 1] = 0.5 * (a[n] + b);
    c[n + 1] = 0.5 * (a[n] - b);
    b = std::sqrt(a[n] * b);
    ++n;
  }
  double phi = std::ldexp(a[n] * u, static_cast<int>(n));
  for (std::size_t k = n; k > 0; --k) phi = 0.5 * (std::asin(c[k] / a[k] * std::sin(phi)) + phi);
  const double sn = std::sin(phi);
  return {sn, std::cos(phi), std::sqrt(1.0 - m * sn * sn)};
}

TEST(GroupStepClosedForms, FreeBodyTurnsByJacobisFunctions) {
  // Landau, Lifshitz, Mechanics, § 37, from ω2 = 0 on and with 2 E I2 < M²
  const double i1 = 1.0, i2 = 1.7, i3 = 2.4, w1 = 0.5, w3 = 1.2;
  const double energy2 = i1 * w1 * w1 + i3 * w3 * w3, m2 = i1 * i1 * w1 * w1 + i3 * i3 * w3 * w3;
  ASSERT_GT(m2, energy2 * i2);
  const double rate = std::sqrt((i3 - i2) * (m2 - energy2 * i1) / (i1 * i2 * i3));
  const double k2 = (i2 - i1) * (energy2 * i3 - m2) / ((i3 - i2) * (m2 - energy2 * i1));
  const double T = 5.0;
  const auto [sn, cn, dn] = jacobi(rate * T, k2);
  const Vector exact =
      (Vector(3) << w1 * cn, std::sqrt((energy2 * i3 - m2) / (i2 * (i3 - i2))) * sn, w3 * dn).finished();
  const auto scene =
      free_body(Eigen::Vector3d(i1, i2, i3).asDiagonal(), (Vector(3) << w1, 0.0, w3).finished());
  std::array<double, 2> errors{};
  for (const int k : {0, 1}) {
    const int steps = 20 << k;
    const Sample end = testing::samples_of(scene, {.method = gl(4), .step = T / steps}, steps,
                                           Momentum::projected, Registry::with_built_ins(), steps)
                           .back();
    errors[static_cast<std::size_t>(k)] = (end.v - exact).norm();
  }
  EXPECT_LT(errors[0], 1e-9);
  EXPECT_LT(errors[1], 1e-11);
}

/// ω₃ = 0 and no gravity: with ψ the angle of (√A ω₁, √B ω₂), ψ' = C/√(AB) cos(ψ − ψ₀), a Gudermannian.
TEST(GroupStepClosedForms, SuslovTendsToItsSteadyRotation) {
  const double a = 1.0, b = 1.7, j13 = 0.3, j23 = -0.2;
  Eigen::Matrix3d inertia;
  inertia << a, 0.0, j13, 0.0, b, j23, j13, j23, 2.4;
  const auto on = group_scenes::rotations();
  auto scene = std::make_shared<Scene>(*free_body(inertia, (Vector(3) << -0.6, 0.9, 0.0).finished(), on));
  scene->constraints = {on_space(on, pfaffian<4, 1>([]<class T>(const std::array<T, 4>&) {
                                   return std::array<std::array<T, 4>, 1>{{{T(0.0), T(0.0), T(1.0), T(0.0)}}};
                                 }))};
  EXPECT_TRUE(reduced_on_group(*scene));
  const double w1 = -0.6, w2 = 0.9, size = std::sqrt(a * w1 * w1 + b * w2 * w2);
  const double c1 = j13 * size / std::sqrt(a), c2 = j23 * size / std::sqrt(b);
  const double C = std::hypot(c1, c2), psi0 = std::atan2(c2, c1);
  const double psi = std::atan2(std::sqrt(b) * w2, std::sqrt(a) * w1);
  const double T = 4.0;
  // u = asinh(tan(ψ − ψ₀)) on the branch where cos(ψ − ψ₀) has its sign
  const double sign = std::cos(psi - psi0) < 0.0 ? -1.0 : 1.0;
  const double reduced = sign < 0.0 ? psi - psi0 - std::acos(-1.0) : psi - psi0;
  const double u = std::asinh(std::tan(reduced)) + sign * C / std::sqrt(a * b) * T;
  const double end_psi = psi0 + 2.0 * std::atan(std::tanh(0.5 * u)) + (sign < 0.0 ? std::acos(-1.0) : 0.0);
  const Sample end = testing::samples_of(scene, {.method = gl(4), .step = T / 40}, 40, Momentum::projected,
                                         Registry::with_built_ins(), 40)
                         .back();
  EXPECT_NEAR(end.v[0], size / std::sqrt(a) * std::cos(end_psi), 1e-11);
  EXPECT_NEAR(end.v[1], size / std::sqrt(b) * std::sin(end_psi), 1e-11);
  EXPECT_NEAR(end.v[2], 0.0, 1e-13);
}

/// The heavy top of Brüls and Cardona, with the numbers of Hante's RATTLie: own reference by extrapolation at
/// t = 1.
TEST(GroupStepClosedForms, HeavyTopOfBrulsAndCardona) {
  const auto top = [](double w) { return 15.0 * 9.81 * w; };
  const double across = 0.234375 + 15.0, along = 0.46875;
  const auto scene = group_scenes::scene_of(
      "heavy top of Bruels and Cardona", group_scenes::rotations(),
      lagrangian<4>([=]<class T>(const std::array<T, 4>& q, const std::array<T, 4>& w) {
        const auto R = group_scenes::matrix_of<4>(q);
        return 0.5 * (across * (w[0] * w[0] + w[2] * w[2]) + along * w[1] * w[1]) - top(1.0) * R[2][1];
      }),
      (Vector(4) << 1.0, 0.0, 0.0, 0.0).finished(), (Vector(3) << 0.0, 150.0, -4.61538).finished());
  const Sample end = testing::samples_of(scene, {.method = gl(4), .step = 4e-3}, 250, Momentum::projected,
                                         Registry::with_built_ins(), 250)
                         .back();
  const auto R = spaces::rotation_matrix(end.q[0], end.q[1], end.q[2], end.q[3]);
  EXPECT_NEAR(R[0][1], 0.17334396410, 5e-10);
  EXPECT_NEAR(R[1][1], 0.64008859207, 5e-10);
  EXPECT_NEAR(R[2][1], -0.74849079113, 5e-10);
  EXPECT_NEAR(end.v[0], -0.8220781017, 2e-8);
  EXPECT_NEAR(end.v[1], 150.0, 1e-10);
  EXPECT_NEAR(end.v[2], -5.923291348, 2e-8);
}

/// One scene on SO(3) and as a unit quaternion with a row in R^4, where L sees ω = 2 q̄ q'.
TEST(GroupStepClosedForms, AgreesWithTheQuaternionAndItsRowToTheErrorsOfBoth) {
  const GroupScene top = group_scenes::heavy_top();
  auto flat = std::make_shared<Scene>();
  flat->name = "top by a quaternion";
  flat->coordinates = {"a", "b", "c", "d"};
  flat->lagrangian = lagrangian<4>(
      [J = group_scenes::generic_inertia()]<class T>(const std::array<T, 4>& q, const std::array<T, 4>& v) {
        const std::array<T, 4> conjugate{q[0], -q[1], -q[2], -q[3]};
        const std::array<T, 4> half = spaces::SO3::product(conjugate, v);
        const auto R = group_scenes::matrix_of<4>(q);
        // a mass along q as well, where the row keeps it still
        T value = group_scenes::quadratic<T>(J, {2.0 * half[1], 2.0 * half[2], 2.0 * half[3]}) +
                  2.0 * half[0] * half[0];
        for (std::size_t i = 0; i < 3; ++i)
          value -= group_scenes::top_k[i] * R[2][i] + 0.5 * group_scenes::top_K[i] * R[2][i] * R[2][i];
        return value;
      });
  flat->constraints = {holonomic<4, 1>([]<class T>(const std::array<T, 4>& q) {
    return std::array<T, 1>{0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0)};
  })};
  const Start& start = top.scene->start;
  const std::array<double, 4> q{start.q[0], start.q[1], start.q[2], start.q[3]},
      w{0.0, start.v[0], start.v[1], start.v[2]};
  const std::array<double, 4> v = spaces::SO3::product(q, w);
  flat->start = {0.0, start.q, 0.5 * Vector::Map(v.data(), 4)};
  const double T = 2.0;
  const Vector reference = group_scenes::reference(top, T);
  const auto end_of_flat = [&](int steps) {
    const Sample end = testing::samples_of(flat, {.method = gl(3), .step = T / steps}, steps,
                                           Momentum::projected, Registry::with_built_ins(), steps)
                           .back();
    const std::array<double, 4> conjugate{end.q[0], -end.q[1], -end.q[2], -end.q[3]},
        rate{end.v[0], end.v[1], end.v[2], end.v[3]};
    const std::array<double, 4> half = spaces::SO3::product(conjugate, rate);
    return top.observe(end.q, 2.0 * Vector::Map(half.data() + 1, 3));
  };
  for (const int steps : {16, 32, 128}) {
    const double of_group = error_at(top, reference, T, steps, gl(3)),
                 of_flat = (end_of_flat(steps) - reference).lpNorm<Eigen::Infinity>();
    EXPECT_LT(of_group, of_flat) << steps;
    if (steps == 128) {
      EXPECT_LT(of_flat, 1e-9);
    }
  }
}

/// The same top by its directors d_i = R e_i in R^9 with six rows, L by Euler's tensor E = tr(J)/2 − J:
/// ½ Σ E_ij d_i'·d_j'.
TEST(GroupStepClosedForms, AgreesWithItsDirectorsToTheErrorsOfBoth) {
  const GroupScene top = group_scenes::heavy_top();
  const Eigen::Matrix3d J = group_scenes::generic_inertia(),
                        E = 0.5 * J.trace() * Eigen::Matrix3d::Identity() - J;
  Scene flat;
  flat.name = "top by its directors";
  for (int i = 0; i < 9; ++i) flat.coordinates.push_back("d" + std::to_string(i));
  flat.lagrangian = lagrangian<9>([E]<class T>(const std::array<T, 9>& d, const std::array<T, 9>& v) {
    T value(0.0);
    for (std::size_t i = 0; i < 3; ++i) {
      const T& height = d[3 * i + 2];
      value -= group_scenes::top_k[i] * height + 0.5 * group_scenes::top_K[i] * height * height;
      for (std::size_t j = 0; j < 3; ++j)
        for (std::size_t k = 0; k < 3; ++k)
          value += 0.5 * E(static_cast<int>(i), static_cast<int>(j)) * v[3 * i + k] * v[3 * j + k];
    }
    return value;
  });
  flat.constraints = {holonomic<9, 6>([]<class T>(const std::array<T, 9>& d) {
    const auto dot = [&](std::size_t i, std::size_t j) {
      return d[3 * i] * d[3 * j] + d[3 * i + 1] * d[3 * j + 1] + d[3 * i + 2] * d[3 * j + 2];
    };
    return std::array<T, 6>{0.5 * (dot(0, 0) - 1.0),
                            0.5 * (dot(1, 1) - 1.0),
                            0.5 * (dot(2, 2) - 1.0),
                            dot(0, 1),
                            dot(1, 2),
                            dot(2, 0)};
  })};
  const Start& start = top.scene->start;
  const auto matrix = spaces::rotation_matrix(start.q[0], start.q[1], start.q[2], start.q[3]);
  Eigen::Matrix3d R, hat;
  for (int i = 0; i < 9; ++i)
    R(i / 3, i % 3) = matrix[static_cast<std::size_t>(i / 3)][static_cast<std::size_t>(i % 3)];
  hat << 0.0, -start.v[2], start.v[1], start.v[2], 0.0, -start.v[0], -start.v[1], start.v[0], 0.0;
  const Eigen::Matrix3d rate = R * hat;
  flat.start = {0.0, R.reshaped(), rate.reshaped()};  // by columns
  const double T = 2.0;
  const Vector reference = group_scenes::reference(top, T);
  for (const int steps : {16, 64}) {
    const Sample end =
        testing::samples_of(std::make_shared<Scene>(flat), {.method = gl(3), .step = T / steps}, steps,
                            Momentum::projected, Registry::with_built_ins(), steps)
            .back();
    const Eigen::Matrix3d there = end.q.reshaped(3, 3), turning = there.transpose() * end.v.reshaped(3, 3);
    Vector observed(12);
    observed << there.transpose().reshaped(), turning(2, 1), turning(0, 2), turning(1, 0);
    const double of_group = error_at(top, reference, T, steps, gl(3)),
                 of_directors = (observed - reference.head(12)).lpNorm<Eigen::Infinity>();
    EXPECT_LT(of_group, of_directors) << steps;
    if (steps == 64) {
      EXPECT_LT(of_directors, 1e-7);
    }
  }
}

}  // namespace
}  // namespace diracstep
