#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/system/scene.hpp>

namespace diracstep {

constexpr double slope = 0.7173560908995228,
                 gravity = 13.750371636040745;  // of knife_edge and pendulum_cartesian

/// Scenes of unit masses: L and the rows as formulas; ∂L/∂q, its derivative, the forms A(q0) and the discrete
/// constraint with its derivative, as columns, in closed form for the step by hand.

/// K skates of coordinates x, y, heading, and a rotor that a spring ties to the heading; one row each.  The
/// skates hang on one another by springs.
template <int K>
struct Skates {
  static constexpr int n = 4 * K, m = K;
  static constexpr double h = 0.1, tie = 2.0, spring = 0.7;
  static constexpr bool quadratic = true, by_position = false;
  template <class T>
  T operator()(const std::array<T, n>& q, const std::array<T, n>& v) const {
    T sum = T(0.0);
    for (std::size_t k = 0; k < n; ++k) sum += 0.5 * v[k] * v[k];
    for (std::size_t k = 0; k < n; k += 4) {
      const T twist = q[k + 2] - q[k + 3];
      sum += slope * q[k] - 0.5 * tie * twist * twist;
      if (k == 0) continue;
      const T dx = q[k] - q[k - 4], dy = q[k + 1] - q[k - 3];
      sum -= 0.5 * spring * (dx * dx + dy * dy);
    }
    return sum;
  }
  template <class T>
  std::array<std::array<T, n>, m> operator()(const std::array<T, n>& q) const {
    using std::cos, std::sin;
    std::array<std::array<T, n>, m> rows{};
    for (std::size_t k = 0; k < m; ++k) {
      rows[k][4 * k] = sin(q[4 * k + 2]);
      rows[k][4 * k + 1] = -cos(q[4 * k + 2]);
    }
    return rows;
  }
  static ConstraintBlocks rows() { return {pfaffian<n, m>(Skates{})}; }
  static Start start() {
    Start start{0.0, Vector::Zero(n), Vector::Zero(n)};
    for (int k = 0; k < m; ++k) start.q[4 * k + 1] = 0.5 * k, start.v[4 * k + 2] = 1.0 + 0.1 * k;
    return start;
  }

  static void force(const auto& q, auto& f, auto& stiffness) {
    stiffness.setZero();
    for (int k = 0; k < n; k += 4) {
      const double twist = tie * (q[k + 2] - q[k + 3]);
      f[k] = slope, f[k + 1] = 0.0, f[k + 2] = -twist, f[k + 3] = twist;
      stiffness(k + 2, k + 2) = stiffness(k + 3, k + 3) = -tie;
      stiffness(k + 2, k + 3) = stiffness(k + 3, k + 2) = tie;
    }
    for (int k = 4; k < n; ++k) {
      if (k % 4 > 1) continue;
      const double tension = spring * (q[k] - q[k - 4]);
      f[k] -= tension, f[k - 4] += tension;
      stiffness(k, k) -= spring, stiffness(k - 4, k - 4) -= spring;
      stiffness(k, k - 4) = stiffness(k - 4, k) = spring;
    }
  }
  static void forms(const auto& q, auto& a) {
    a.setZero();
    for (int k = 0; k < m; ++k)
      a(4 * k, k) = std::sin(q[4 * k + 2]), a(4 * k + 1, k) = -std::cos(q[4 * k + 2]);
  }
  static void constraint(const auto& q0, const auto& q1, auto& c, auto& a) {
    a.setZero();
    for (int k = 0; k < m; ++k) {
      const int x = 4 * k, y = x + 1, heading = x + 2;
      const double angle = 0.5 * (q0[heading] + q1[heading]), sine = std::sin(angle),
                   cosine = std::cos(angle);
      a(x, k) = sine, a(y, k) = -cosine;
      a(heading, k) = 0.5 * (cosine * (q1[x] - q0[x]) + sine * (q1[y] - q0[y]));
      c[k] = sine * (q1[x] - q0[x]) - cosine * (q1[y] - q0[y]);
    }
  }
};

struct KnifeEdge {
  static constexpr int n = 3, m = 1;
  static constexpr double h = 0.25;
  static constexpr bool quadratic = true, by_position = false;
  template <class T>
  T operator()(const std::array<T, 3>& q, const std::array<T, 3>& v) const {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) + 0.5 * v[2] * v[2] + slope * q[0];
  }
  template <class T>
  std::array<std::array<T, 3>, 1> operator()(const std::array<T, 3>& q) const {
    using std::cos, std::sin;
    return {{{sin(q[2]), -cos(q[2]), T(0.0)}}};
  }
  static ConstraintBlocks rows() { return {pfaffian<3, 1>(KnifeEdge{})}; }
  static Start start() { return {0.0, Vector::Zero(3), Vector::Unit(3, 2)}; }

  static void force(const auto&, auto& f, auto&) { f[0] = slope; }
  static void forms(const auto& q, auto& a) { a << std::sin(q[2]), -std::cos(q[2]), 0.0; }
  static void constraint(const auto& q0, const auto& q1, auto& value, auto& a) {
    const double angle = 0.5 * (q0[2] + q1[2]), s = std::sin(angle), c = std::cos(angle);
    a << s, -c, 0.5 * (c * (q1[0] - q0[0]) + s * (q1[1] - q0[1]));
    value[0] = s * (q1[0] - q0[0]) - c * (q1[1] - q0[1]);
  }
};

struct Pendulum {
  static constexpr int n = 2, m = 1;
  static constexpr double h = 0.05;
  static constexpr bool quadratic = true, by_position = true;
  template <class T>
  T operator()(const std::array<T, 2>& q, const std::array<T, 2>& v) const {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) - gravity * q[1];
  }
  template <class T>
  std::array<T, 1> operator()(const std::array<T, 2>& q) const {
    return {q[0] * q[0] + q[1] * q[1] - 1.0};
  }
  static ConstraintBlocks rows() { return {holonomic<2, 1>(Pendulum{})}; }
  static Start start() { return {0.0, Vector::Unit(2, 0), Vector::Zero(2)}; }

  static void force(const auto&, auto& f, auto&) { f[1] = -gravity; }
  static void forms(const auto& q, auto& a) { a = 2.0 * q; }
  static void constraint(const auto&, const auto& q1, auto& value, auto& a) {
    a = 2.0 * q1;
    value[0] = q1.squaredNorm() - 1.0;
  }
};

struct Kepler {
  static constexpr int n = 2, m = 0;
  static constexpr double h = 0.05;
  static constexpr bool quadratic = false, by_position = false;
  template <class T>
  T operator()(const std::array<T, 2>& q, const std::array<T, 2>& v) const {
    using std::sqrt;
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) + 1.0 / sqrt(q[0] * q[0] + q[1] * q[1]);
  }
  static ConstraintBlocks rows() { return {}; }
  static Start start() { return {0.0, 0.4 * Vector::Unit(2, 0), 2.0 * Vector::Unit(2, 1)}; }

  static void force(const auto& q, auto& f, auto& stiffness) {
    const double r2 = 1.0 / q.squaredNorm(), r3 = r2 * std::sqrt(r2);
    f = -r3 * q;
    stiffness.noalias() = 3.0 * r3 * r2 * q * q.transpose();
    stiffness.diagonal().array() -= r3;
  }
};

/// Nonlinear springs between twelve masses and two walls: V = Σ d²/2 + d⁴/4.
struct Springs {
  static constexpr int n = 12, m = 0;
  static constexpr double h = 0.1;
  static constexpr bool quadratic = false, by_position = false;
  template <class T>
  T operator()(const std::array<T, 12>& q, const std::array<T, 12>& v) const {
    T sum = -0.5 * q[0] * q[0] - 0.25 * q[0] * q[0] * q[0] * q[0];
    for (std::size_t i = 0; i < 12; ++i) {
      const T d = i + 1 < 12 ? q[i + 1] - q[i] : -q[i];
      sum += 0.5 * v[i] * v[i] - 0.5 * d * d - 0.25 * d * d * d * d;
    }
    return sum;
  }
  static ConstraintBlocks rows() { return {}; }
  static Start start() { return {0.0, Vector::LinSpaced(12, -0.5, 0.5).array().sin(), Vector::Zero(12)}; }

  static void force(const auto& q, auto& f, auto& stiffness) {
    stiffness.setZero();
    f.setZero();
    for (int i = 0; i <= 12; ++i) {  // the spring between masses i−1 and i
      const double d = (i < 12 ? q[i] : 0.0) - (i > 0 ? q[i - 1] : 0.0);
      const double tension = d + d * d * d, slope_of_tension = 1.0 + 3.0 * d * d;
      if (i < 12) f[i] -= tension, stiffness(i, i) -= slope_of_tension;
      if (i > 0) f[i - 1] += tension, stiffness(i - 1, i - 1) -= slope_of_tension;
      if (i > 0 && i < 12) stiffness(i, i - 1) = stiffness(i - 1, i) = slope_of_tension;
    }
  }
};

}  // namespace diracstep
