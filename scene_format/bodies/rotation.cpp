#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/bodies/rotation.hpp>

namespace diracstep::bodies {

namespace {

Rotation::Quaternion named_quaternion(const std::string& prefix) {
  const auto part = [&](int i) { return Formula::name(fmt::format("{}_q{}", prefix, i)); };
  return {part(0), part(1), part(2), part(3)};
}

/// 2 conj(q) v for a rate in the body, 2 v conj(q) in space: its vector part.
Vec twice_product(const Rotation::Quaternion& q, const Rotation::Quaternion& v, bool in_space) {
  const Vec a{q[1], q[2], q[3]}, b{v[1], v[2], v[3]};
  const Vec turned = in_space ? cross(a, b) : cross(b, a);
  const auto part = [&](std::size_t k) { return 2.0 * (q[0] * b[k] - a[k] * v[0] + turned[k]); };
  return {part(0), part(1), part(2)};
}

}  // namespace

std::string Rotation::coordinate(int i) const { return fmt::format("{}_q{}", body_, i); }

std::string Rotation::row() const {
  return fmt::format("{0}_q0^2 + {0}_q1^2 + {0}_q2^2 + {0}_q3^2 - 1 = 0", body_);
}

Matrix Rotation::matrix() const {
  Matrix entries = unit_matrix();
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      entries[i][j] = Formula::name(fmt::format("{}_R{}{}", body_, i + 1, j + 1));
  return entries;
}

Vec Rotation::rate() const {
  return {Formula::name(body_ + "_w1"), Formula::name(body_ + "_w2"), Formula::name(body_ + "_w3")};
}

Vec Rotation::rate_in_space() const {
  return {Formula::name(body_ + "_wx"), Formula::name(body_ + "_wy"), Formula::name(body_ + "_wz")};
}

std::vector<std::pair<std::string, Formula>> Rotation::definitions() const {
  const Quaternion q = named_quaternion(body_), v = named_quaternion("v_" + body_);
  std::vector<std::pair<std::string, Formula>> all;
  const Matrix names = matrix(), entries = matrix_of(q);
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) all.emplace_back(names[i][j].text(), entries[i][j]);
  for (const bool in_space : {false, true}) {
    const Vec of = in_space ? rate_in_space() : rate(), w = twice_product(q, v, in_space);
    for (std::size_t k = 0; k < 3; ++k) all.emplace_back(of[k].text(), w[k]);
  }
  return all;
}

Rotation::Quaternion Rotation::start_rate(const Quaternion& q, const Vec& w) {
  const Vec a{q[1], q[2], q[3]}, turned = cross(a, w);
  const auto part = [&](std::size_t k) { return 0.5 * (q[0] * w[k] + turned[k]); };
  return {-(0.5 * dot(a, w)), part(0), part(1), part(2)};
}

Rotation::Quaternion Rotation::forces(const Vec& torque) const {
  const Quaternion q = named_quaternion(body_);
  const Vec a{q[1], q[2], q[3]}, turned = cross(a, torque);
  const auto part = [&](std::size_t k) { return 2.0 * (q[0] * torque[k] + turned[k]); };
  return {-(2.0 * dot(a, torque)), part(0), part(1), part(2)};
}

Matrix matrix_of(const Rotation::Quaternion& q) {
  const auto diagonal = [&](std::size_t i, std::size_t j, std::size_t k) {
    return square(q[0]) + square(q[i]) - square(q[j]) - square(q[k]);
  };
  const auto off = [&](std::size_t i, std::size_t j, std::size_t k, double sign) {
    return 2.0 * (q[i] * q[j] + sign * (q[0] * q[k]));
  };
  return {{{diagonal(1, 2, 3), off(1, 2, 3, -1.0), off(1, 3, 2, 1.0)},
           {off(1, 2, 3, 1.0), diagonal(2, 1, 3), off(2, 3, 1, -1.0)},
           {off(1, 3, 2, -1.0), off(2, 3, 1, 1.0), diagonal(3, 1, 2)}}};
}

double distance_from_rotations(const Numbers& r) {
  double off = 0.0;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      double product = 0.0;
      for (std::size_t k = 0; k < 3; ++k) product += r[i][k] * r[j][k];
      off = std::max(off, std::abs(product - (i == j ? 1.0 : 0.0)));
    }
  const double determinant = r[0][0] * (r[1][1] * r[2][2] - r[1][2] * r[2][1]) -
                             r[0][1] * (r[1][0] * r[2][2] - r[1][2] * r[2][0]) +
                             r[0][2] * (r[1][0] * r[2][1] - r[1][1] * r[2][0]);
  return determinant > 0.0 ? off : std::max(off, 2.0);  // determinants of reflections are off by 2
}

Rotation::Quaternion quaternion_of(const Numbers& r) {
  const std::array<double, 4> squares{1.0 + r[0][0] + r[1][1] + r[2][2], 1.0 + r[0][0] - r[1][1] - r[2][2],
                                      1.0 - r[0][0] + r[1][1] - r[2][2], 1.0 - r[0][0] - r[1][1] + r[2][2]};
  const auto largest = static_cast<std::size_t>(std::ranges::max_element(squares) - squares.begin());
  const double wx = r[2][1] - r[1][2], wy = r[0][2] - r[2][0], wz = r[1][0] - r[0][1], xy = r[0][1] + r[1][0],
               xz = r[0][2] + r[2][0], yz = r[1][2] + r[2][1];
  const std::array<std::array<double, 4>, 4> parts{{{squares[0], wx, wy, wz},
                                                    {wx, squares[1], xy, xz},
                                                    {wy, xy, squares[2], yz},
                                                    {wz, xz, yz, squares[3]}}};
  const std::array<double, 4>& q = parts[largest];
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return {q[0] / length, q[1] / length, q[2] / length, q[3] / length};
}

Rotation::Quaternion from_z_to(const Vec& axis) {
  if (axis[2].value() < -0.5) {  // beyond a half turn about x, which takes z to −z
    const Rotation::Quaternion q = from_z_to({axis[0], -axis[1], -axis[2]});
    return {-q[1], q[0], -q[3], q[2]};
  }
  const Formula half = root(0.5 * (1.0 + axis[2]));  // cosine of half the angle
  return {half, -axis[1] / (2.0 * half), axis[0] / (2.0 * half), 0.0};
}

}  // namespace diracstep::bodies
