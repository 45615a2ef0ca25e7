/// Lagrangians whose constraints need the constraint algorithm on combinations of equations, or more than one
/// time derivative, with references: reductions by hand, extrapolated in long double, and a closed form.
#pragma once

#include "kernel_cases.hpp"

namespace diracstep::testing {

/// A pendulum in canonical coordinates, the rod a row between positions of canonical pairs.
inline DegenerateCase canonical_pendulum() {
  Scene scene = scene_of("canonical pendulum", {"x", "y", "p", "r"});
  scene.lagrangian = lagrangian<4>([](const auto& q, const auto& v) {
    return q[2] * v[0] + q[3] * v[1] - 0.5 * (q[2] * q[2] + q[3] * q[3]) - q[1];
  });
  scene.constraints = {holonomic<4, 1>(
      []<class T>(const std::array<T, 4>& q) { return std::array<T, 1>{q[0] * q[0] + q[1] * q[1] - 1.0}; },
      {"rod"})};
  scene.start = {0.0, Vector{{1.0, 0.0, 0.0, 0.6}}, Vector{{0.0, 0.6, 0.0, 0.0}}};
  const LongVector end = extrapolated(  // of (x, y) = (sin θ, −cos θ)
      [](LongReal, const LongVector& y) {
        return LongVector{{y[1], -std::sin(y[0])}};
      },
      LongVector{{std::acos(-1.0L) / 2, LongReal(0.6)}}, 1.0L);
  const LongReal s = std::sin(end[0]), c = std::cos(end[0]), w = end[1];
  return {std::make_shared<const Scene>(scene), LongVector{{s, -c, w * c, w * s}}.cast<double>(),
          Vector::Constant(1, static_cast<double>((-c - w * w) / 2))};
}

/// A row v_y = x v_x between positions of canonical pairs, damped and driven.
inline DegenerateCase canonical_nonholonomic() {
  Scene scene = scene_of("canonical, nonholonomic, forced", {"x", "y", "p", "r"});
  scene.lagrangian = lagrangian<4>([](const auto& q, const auto& v) {
    return q[2] * v[0] + q[3] * v[1] - 0.5 * (q[2] * q[2] + q[3] * q[3] + q[0] * q[0] + q[1] * q[1]) -
           0.3 * q[0] * q[1];
  });
  scene.force = force<4>([]<class T>(const std::array<T, 4>&, const std::array<T, 4>& v, const T& t) {
    using std::cos;
    return std::array<T, 4>{-0.2 * v[0] + 0.3 * cos(t), T(0.0), T(0.0), T(0.0)};
  });
  scene.constraints = {pfaffian<4, 1>(
      []<class T>(const std::array<T, 4>& q) {
        return std::array<std::array<T, 4>, 1>{{{-q[0], T(1.0), T(0.0), T(0.0)}}};
      },
      {"slope"})};
  scene.start = {0.0, Vector{{0.7, -0.2, 0.5, 0.35}}, Vector{{0.5, 0.35, 0.0, 0.0}}};
  const auto pushed = [](LongReal t, const LongVector& y) {  // p' of y = (x, y, p), r = x p
    const LongReal fx = -y[0] - 0.3L * y[1] - 0.2L * y[2] + 0.3L * std::cos(t), fy = -y[1] - 0.3L * y[0];
    return (fx + y[0] * (fy - y[2] * y[2])) / (1 + y[0] * y[0]);
  };
  const LongVector end = extrapolated(
      [pushed](LongReal t, const LongVector& y) {
        return LongVector{{y[2], y[0] * y[2], pushed(t, y)}};
      },
      LongVector{{LongReal(0.7), LongReal(-0.2), LongReal(0.5)}}, 1.0L);
  const LongReal push = end[2] * end[2] + end[0] * pushed(1.0L, end) + end[1] + 0.3L * end[0];
  return {std::make_shared<const Scene>(scene),
          LongVector{{end[0], end[1], end[2], end[0] * end[2]}}.cast<double>(),
          Vector::Constant(1, static_cast<double>(push))};
}

/// θ·v − H in three coordinates: the kernel of dθ, which turns, tells a constraint.
inline DegenerateCase odd_two_form() {
  Scene scene = scene_of("odd two-form", {"x", "y", "z"});
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (1.0 + q[2]) * (q[0] * v[1] - q[1] * v[0]) - 0.5 * (q[0] * q[0] + 1.3 * q[1] * q[1]) -
           0.3 * q[0] * q[2] - 2.0 * q[2] * q[2];
  });
  const auto gradient = [](const LongVector& y) {
    return LongVector{{y[0] + 0.3L * y[2], 1.3L * y[1], 0.3L * y[0] + 4 * y[2]}};
  };
  const auto hidden = [gradient](LongReal, const LongVector& y) {
    const LongVector g = gradient(y);
    return (y[0] * g[0] + y[1] * g[1]) / 2 - (1 + y[2]) * g[2];
  };
  const auto rate = [gradient](LongReal, const LongVector& y, LongReal u) {
    const LongVector g = gradient(y);
    return LongVector{{(-g[1] - y[0] * u / 2) / (1 + y[2]), (g[0] - y[1] * u / 2) / (1 + y[2]), u}};
  };
  LongVector y{{0.8L, 0.3L, 0.0L}};
  solve_for_third(hidden, y);
  scene.start = {0.0, y.cast<double>(), Vector::Zero(3)};
  const LongVector end = extrapolated(
      [&](LongReal t, const LongVector& at) { return with_hidden_rate(rate, hidden, t, at); }, y, 1.0L);
  return {std::make_shared<const Scene>(scene), end.cast<double>()};
}

/// Two vortices, L = x1 v_y1 + x2 v_y2 − H, the first on a wall y1 = 0.3 x1² that moves.
inline DegenerateCase vortex_on_a_wall() {
  Scene scene = scene_of("vortex on a wall", {"x1", "y1", "x2", "y2"});
  scene.lagrangian = lagrangian<4>([](const auto& q, const auto& v) {
    using std::log;
    const auto dx = q[0] - q[2], dy = q[1] - q[3];
    return q[0] * v[1] + q[2] * v[3] - 0.5 * log(1.0 + dx * dx + dy * dy) -
           0.25 * (q[0] * q[0] + 2.0 * q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  });
  scene.constraints = {holonomic<4, 1>(
      []<class T>(const std::array<T, 4>& q, const T& t) {
        using std::sin;
        return std::array<T, 1>{q[1] - 0.3 * q[0] * q[0] - 0.1 * sin(t)};
      },
      {"wall"})};
  const auto gradient = [](const LongVector& y) {
    const LongReal dx = y[0] - y[2], dy = y[1] - y[3], d = 1 + dx * dx + dy * dy;
    return LongVector{{dx / d + y[0] / 2, dy / d + y[1], -dx / d + y[2] / 2, -dy / d + y[3] / 2}};
  };
  const auto hidden = [gradient](LongReal t, const LongVector& y) {
    const LongVector g = gradient(y);
    return 0.6L * y[0] * g[1] + g[0] - 0.1L * std::cos(t);
  };
  const auto rate = [gradient](LongReal, const LongVector& y, LongReal push) {
    const LongVector g = gradient(y);
    return LongVector{{-g[1] + push, g[0] + 0.6L * y[0] * push, -g[3], g[2]}};
  };
  // x2 by Newton's method, on the hidden constraint.
  LongVector y{{0.4L, 0.3L * 0.16L, 0.0L, 0.7L}};
  for (int k = 0; k < 60; ++k) {
    LongVector beside = y;
    beside[2] += 1e-6L;
    y[2] -= hidden(0.0L, y) * 1e-6L / (hidden(0.0L, beside) - hidden(0.0L, y));
  }
  scene.start = {0.0, y.cast<double>(), Vector::Zero(4)};
  const LongVector end = extrapolated(
      [&](LongReal t, const LongVector& at) { return with_hidden_rate(rate, hidden, t, at); }, y, 1.0L);
  const LongReal push = with_hidden_rate(rate, hidden, 1.0L, end)[0] + gradient(end)[1];
  return {std::make_shared<const Scene>(scene), end.cast<double>(),
          Vector::Constant(1, static_cast<double>(push))};
}

/// A mass that is to be at x = sin t, by a force z with a lag, z + v_z/2: constraints x, then p, then the
/// velocity of z, which is z' = 2(sin t − z).
inline DegenerateCase lagging_servo() {
  Scene scene = scene_of("lagging servo", {"x", "p", "z"});
  scene.lagrangian =
      lagrangian<3>([]<class T>(const std::array<T, 3>& q, const std::array<T, 3>& v, const T& t) {
        using std::sin;
        return q[1] * v[0] - 0.5 * q[1] * q[1] - q[2] * (q[0] - sin(t));
      });
  scene.force = force<3>([]<class T>(const std::array<T, 3>&, const std::array<T, 3>& v) {
    return std::array<T, 3>{-0.5 * v[2], T(0.0), T(0.0)};
  });
  scene.start = {0.0, Vector{{0.0, 1.0, 0.3}}, Vector{{1.0, 0.0, -0.6}}};
  const double s = std::sin(1.0), c = std::cos(1.0);
  // z = (4 sin t − 2 cos t)/5 + C exp(−2t)
  return {std::make_shared<const Scene>(scene),
          Vector{{s, c, (4.0 * s - 2.0 * c) / 5.0 + 0.7 * std::exp(-2.0)}}};
}

/// The pendulum in canonical coordinates with the force of its rod as a coordinate: three levels.
inline DegenerateCase canonical_pendulum_by_multiplier() {
  const DegenerateCase by_row = canonical_pendulum();
  Scene scene = scene_of("canonical pendulum by a multiplier", {"x", "y", "p", "r", "a"});
  scene.lagrangian = lagrangian<5>([](const auto& q, const auto& v) {
    return q[2] * v[0] + q[3] * v[1] - 0.5 * (q[2] * q[2] + q[3] * q[3]) - q[1] +
           q[4] * (q[0] * q[0] + q[1] * q[1] - 1.0);
  });
  scene.start = {0.0, Vector{{1.0, 0.0, 0.0, 0.6, -0.18}}, Vector::Zero(5)};
  Vector end(5);
  end << by_row.q, by_row.lambda;
  return {std::make_shared<const Scene>(scene), end};
}

/// The first of two masses on a spring is to be at x = sin 2t, by a force z on the second: five levels, which
/// give y = x + x'' and z = y'' + y − x.
inline DegenerateCase far_servo() {
  Scene scene = scene_of("far servo", {"x", "p", "y", "r", "z"});
  scene.lagrangian = lagrangian<5>([](const auto& q, const auto& v) {
    return q[1] * v[0] + q[3] * v[2] - 0.5 * (q[1] * q[1] + q[3] * q[3]) -
           0.5 * (q[0] - q[2]) * (q[0] - q[2]);
  });
  scene.force = force<5>([]<class T>(const std::array<T, 5>& q, const std::array<T, 5>&, const T& t) {
    using std::sin;
    return std::array<T, 5>{T(0.0), T(0.0), q[4], T(0.0), q[0] - sin(2.0 * t)};
  });
  scene.start = {0.0, Vector{{0.0, 2.0, 0.0, -6.0, 0.0}}, Vector{{2.0, 0.0, -6.0, 0.0, 16.0}}};
  const double s = std::sin(2.0), c = std::cos(2.0);
  return {std::make_shared<const Scene>(scene), Vector{{s, 2.0 * c, -3.0 * s, -6.0 * c, 8.0 * s}}};
}

inline const std::vector<DegenerateCase>& levelled_cases() {
  static const std::vector<DegenerateCase> cases{canonical_pendulum(), canonical_nonholonomic(),
                                                 odd_two_form(), vortex_on_a_wall()};
  return cases;
}

}  // namespace diracstep::testing
