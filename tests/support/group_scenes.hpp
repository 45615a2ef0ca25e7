#pragma once

#include <array>
#include <cmath>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/system/on_space.hpp>
#include <diracstep/core/system/scene.hpp>
#include <functional>
#include <memory>
#include <string>
#include <vector>

/// Scenes on Lie groups and spheres, each with its equations of motion a second time, written by hand from
/// Newton and Euler in extended precision on matrix entries, and an extrapolation code that integrates these.
namespace diracstep::group_scenes {

using Real = long double;
using spaces::Retraction;
using Column = std::vector<Real>;
using V3 = std::array<Real, 3>;

inline V3 cross(const V3& a, const V3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline V3 plus(const V3& a, const V3& b, Real s = 1) {
  return {a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]};
}
inline Real dot(const V3& a, const V3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline V3 three(const Column& y, std::size_t at) { return {y[at], y[at + 1], y[at + 2]}; }

using ExtendedMatrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;

inline V3 times(const Eigen::Matrix3d& m, const V3& v) {
  V3 y{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      y[static_cast<std::size_t>(i)] += Real(m(i, j)) * v[static_cast<std::size_t>(j)];
  return y;
}

/// One solve of a small full system by elimination with pivots.
inline ExtendedVector solved(ExtendedMatrix a, ExtendedVector b) {
  const Eigen::Index n = a.rows();
  for (Eigen::Index k = 0; k < n; ++k) {
    Eigen::Index p = k;
    for (Eigen::Index i = k; i < n; ++i)
      if (std::abs(a(i, k)) > std::abs(a(p, k))) p = i;
    a.row(k).swap(a.row(p));
    std::swap(b[k], b[p]);
    for (Eigen::Index i = k + 1; i < n; ++i) {
      const Real f = a(i, k) / a(k, k);
      a.row(i) -= f * a.row(k);
      b[i] -= f * b[k];
    }
  }
  for (Eigen::Index k = n - 1; k >= 0; --k) {
    for (Eigen::Index j = k + 1; j < n; ++j) b[k] -= a(k, j) * b[j];
    b[k] /= a(k, k);
  }
  return b;
}

using Rates = std::function<Column(const Column&)>;

struct GroupScene {
  std::string name;
  std::shared_ptr<const Scene> scene;
  /// What is compared: entries of the group and velocities.
  std::function<Vector(const Vector& q, const Vector& v)> observe;
  Rates rates;  ///< of the same numbers, by hand
};

inline std::shared_ptr<Scene> scene_of(std::string name, std::shared_ptr<const Space> space,
                                       std::shared_ptr<const Lagrangian> lagrangian, Vector q, Vector v) {
  auto scene = std::make_shared<Scene>();
  scene->name = std::move(name);
  for (int i = 0; i < space->dimension(); ++i) scene->coordinates.push_back("w" + std::to_string(i));
  scene->lagrangian = on_space(space, std::move(lagrangian));
  scene->start = {0.0, space->normalised(std::move(q)), std::move(v)};
  scene->space = std::move(space);
  return scene;
}

template <int N, class T>
std::array<std::array<T, 3>, 3> matrix_of(const std::array<T, static_cast<std::size_t>(N)>& q) {
  return spaces::rotation_matrix(q[0], q[1], q[2], q[3]);
}

/// The entries of R row by row, then further ones of q, then v.
inline Vector entries(const Vector& q, const Vector& v) {
  const auto R = spaces::rotation_matrix(q[0], q[1], q[2], q[3]);
  Vector all(9 + q.size() - 4 + v.size());
  for (std::size_t i = 0; i < 9; ++i) all[static_cast<Eigen::Index>(i)] = R[i / 3][i % 3];
  all.segment(9, q.size() - 4) = q.tail(q.size() - 4);
  all.tail(v.size()) = v;
  return all;
}

/// R' = R ω^ of nine entries at the front of y.
inline void turn(const Column& y, const V3& w, Column& rate) {
  for (std::size_t i = 0; i < 3; ++i) {
    const V3 turned = cross({y[3 * i], y[3 * i + 1], y[3 * i + 2]}, w);
    for (std::size_t j = 0; j < 3; ++j) rate[3 * i + j] = turned[j];
  }
}
/// Rᵀ u
inline V3 to_body(const Column& y, const V3& u) {
  V3 v{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) v[j] += y[3 * i + j] * u[i];
  return v;
}
inline V3 to_space(const Column& y, const V3& v) {
  V3 u{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) u[i] += y[3 * i + j] * v[j];
  return u;
}

inline Eigen::Matrix3d generic_inertia() {
  return (Eigen::Matrix3d() << 1.0, 0.1, -0.05, 0.1, 1.7, 0.2, -0.05, 0.2, 2.4).finished();
}
inline Vector generic_rotation() { return (Vector(4) << 0.9, 0.2, -0.3, 0.25).finished(); }

template <class T>
T quadratic(const Eigen::Matrix3d& m, const std::array<T, 3>& w) {
  T sum(0.0);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      sum += 0.5 * m(i, j) * (w[static_cast<std::size_t>(i)] * w[static_cast<std::size_t>(j)]);
  return sum;
}

template <Retraction kind = Retraction::exponential>
std::shared_ptr<const Space> rotations();

/// ℓ = ½ ω·Jω − k·γ − ½ γ·Kγ with γ = Rᵀe₃ and K = diag(0.4, 0, −0.3).
constexpr std::array<double, 3> top_k{0.3, -0.2, 1.1}, top_K{0.4, 0.0, -0.3};

inline V3 top_torque(const Column& y) {
  const V3 gamma{y[6], y[7], y[8]};
  V3 gradient;
  for (std::size_t i = 0; i < 3; ++i) gradient[i] = Real(top_k[i]) + Real(top_K[i]) * gamma[i];
  return cross(gamma, gradient);
}

GroupScene heavy_top(const std::shared_ptr<const Space>& space = rotations());
/// The same top under friction and a torque that depends on the time: a last entry of the numbers by hand.
GroupScene driven_top(const std::shared_ptr<const Space>& space = rotations());
GroupScene suslov(const std::shared_ptr<const Space>& space = rotations());

/// A top whose centre of mass x = R r is a coordinate of its own with three holonomic rows; SO3 x R3.
template <Retraction kind = Retraction::exponential>
GroupScene top_with_rows();
/// A body on a spring, SE3.
template <Retraction kind = Retraction::exponential>
GroupScene body_on_spring();

/// These and a Chaplygin ball, a sleigh and a spherical pendulum.
template <Retraction kind = Retraction::exponential>
std::vector<GroupScene> all_scenes();

/// What is compared at t = T, by hand.
Vector reference(const GroupScene& of, double T, int steps = 200);

}  // namespace diracstep::group_scenes
