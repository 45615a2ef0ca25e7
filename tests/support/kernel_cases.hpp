/// Lagrangians whose kernel of ∂²L/∂v² moves, or whose equations along it hold velocities but none along it,
/// with references: reductions by hand, extrapolated in long double.
#pragma once

#include <cmath>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/system/scene.hpp>
#include <string>
#include <vector>

#include "degenerate_cases.hpp"
#include "extrapolation.hpp"

namespace diracstep::testing {

inline Scene scene_of(const std::string& name, const std::vector<std::string>& coordinates) {
  Scene scene;
  scene.name = name;
  scene.coordinates = coordinates;
  return scene;
}

/// y' = α + βu of y and t, with u from dg/dt = 0: the hidden equation g = 0 differentiated.
template <class Rate, class Hidden>
inline LongVector with_hidden_rate(Rate rate, Hidden hidden, LongReal t, const LongVector& y) {
  LongVector yt(y.size() + 1);
  yt << y, t;
  const auto of = [&](const LongVector& at) {
    return LongVector::Constant(1, hidden(at[y.size()], LongVector(at.head(y.size()))));
  };
  const LongMatrix g = long_jacobian(of, yt);
  const LongVector still = rate(t, y, 0.0L), along = rate(t, y, 1.0L) - still;
  const LongReal u = -(g.leftCols(y.size()) * still + g.rightCols(1))(0) / (g.leftCols(y.size()) * along)(0);
  return still + u * along;
}

// A mass that depends on a coordinate without velocity.

/// s of  s(4 − w²/(1 + s²)²) + c = 0.
inline LongReal root(LongReal w, LongReal c) {
  LongReal s = -c / 4;
  for (int k = 0; k < 60; ++k) {
    const LongReal d = 1 + s * s, f = s * (4 - w * w / (d * d)) + c,
                   df = 4 - w * w / (d * d) + 4 * s * s * w * w / (d * d * d);
    s -= f / df;
  }
  return s;
}

/// L = (1 + s²) v_x²/2 − x²/2 − 2s² − s x/2.
inline DegenerateCase inner_coordinate() {
  Scene scene = scene_of("inner coordinate", {"x", "s"});
  scene.lagrangian = lagrangian<2>([](const auto& q, const auto& v) {
    return 0.5 * (1.0 + q[1] * q[1]) * v[0] * v[0] - 0.5 * q[0] * q[0] - 2.0 * q[1] * q[1] -
           0.5 * q[0] * q[1];
  });
  const double speed = 0.7, s = -0.5 * 0.8 / (4.0 - speed * speed);
  scene.start = {0.0, Vector{{0.8, s}}, Vector{{speed, 0.0}}};
  const LongReal s0 = -0.5L * LongReal(0.8) / (4 - LongReal(speed) * LongReal(speed));
  const LongVector end = extrapolated(
      [](LongReal, const LongVector& y) {
        const LongReal z = root(y[1], 0.5L * y[0]);
        return LongVector{{y[1] / (1 + z * z), -y[0] - 0.5L * z}};
      },
      LongVector{{LongReal(0.8), LongReal(speed) * (1 + s0 * s0)}}, 1.0L);
  const LongReal z = root(end[1], 0.5L * end[0]);
  return {std::make_shared<const Scene>(scene), LongVector{{end[0], z}}.cast<double>()};
}

/// The same with two positions, a row v_y = a v_x + b, a = 0.3 x + 0.2 sin t, b = 0.1, damping, and a force
/// along s.
inline DegenerateCase inner_coordinate_with_row() {
  Scene scene = scene_of("inner coordinate, nonholonomic, forced", {"x", "y", "s"});
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (1.0 + q[2] * q[2]) * (v[0] * v[0] + v[1] * v[1]) - 0.5 * (q[0] * q[0] + q[1] * q[1]) -
           2.0 * q[2] * q[2] - q[2] * (0.5 * q[0] + 0.3 * q[1]);
  });
  scene.constraints = {affine<3, 1>(
      []<class T>(const std::array<T, 3>& q, const T& t) {
        using std::sin;
        return std::array<std::array<T, 3>, 1>{{{-0.3 * q[0] - 0.2 * sin(t), T(1.0), T(0.0)}}};
      },
      []<class T>(const std::array<T, 3>&, const T&) { return std::array<T, 1>{T(-0.1)}; }, {"row"})};
  scene.force = force<3>([]<class T>(const std::array<T, 3>&, const std::array<T, 3>& v, const T& t) {
    using std::cos;
    return std::array<T, 3>{-0.2 * v[0], -0.1 * v[1], 0.1 * cos(t)};
  });
  const auto a = [](LongReal t, LongReal x) { return 0.3L * x + 0.2L * std::sin(t); };
  struct Point {
    LongReal vx, vy, s, py;
  };
  // y = (x, y, P), P = p_x + a p_y = (1 + s²)(v_x + a v_y); v_x and s by fixed-point iteration.
  const auto solve = [a](LongReal t, const LongVector& y) {
    Point at{0, 0, 0, 0};
    const LongReal slope = a(t, y[0]), c = 0.5L * y[0] + 0.3L * y[1] - 0.1L * std::cos(t);
    for (int k = 0; k < 400; ++k) {
      at.vx = (y[2] / (1 + at.s * at.s) - 0.1L * slope) / (1 + slope * slope);
      at.vy = slope * at.vx + 0.1L;
      at.s = -c / (4 - at.vx * at.vx - at.vy * at.vy);
    }
    at.py = (1 + at.s * at.s) * at.vy;
    return at;
  };
  const auto rate = [=](LongReal t, const LongVector& y) {
    const Point at = solve(t, y);
    const LongReal slope = a(t, y[0]), fx = -y[0] - 0.5L * at.s - 0.2L * at.vx,
                   fy = -y[1] - 0.3L * at.s - 0.1L * at.vy;
    return LongVector{{at.vx, at.vy, fx + slope * fy + (0.3L * at.vx + 0.2L * std::cos(t)) * at.py}};
  };
  const LongVector start{{0.6L, 0.3L, 0.5L}};
  const Point first = solve(0, start);
  scene.start = {0.0, LongVector{{start[0], start[1], first.s}}.cast<double>(),
                 LongVector{{first.vx, first.vy, 0.0L}}.cast<double>()};
  const LongVector end = extrapolated(rate, start, 1.0L);
  const Point last = solve(1, end);
  LongVector there(4);
  there << end, 1.0L;
  const LongMatrix by = long_jacobian(
      [&](const LongVector& yt) { return LongVector::Constant(1, solve(yt[3], yt.head(3)).py); }, there);
  const LongReal push =
      (by.leftCols(3) * rate(1, end))(0) + by(0, 3) + end[1] + 0.3L * last.s + 0.1L * last.vy;
  return {std::make_shared<const Scene>(scene), LongVector{{end[0], end[1], last.s}}.cast<double>(),
          Vector::Constant(1, static_cast<double>(push))};
}

/// On the unit circle, with x = cos θ, y = sin θ:  L = (1 + s²) θ'²/2 − y − 2s² − s x/2.
inline DegenerateCase inner_coordinate_on_circle() {
  Scene scene = scene_of("inner coordinate, holonomic", {"x", "y", "s"});
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    return 0.5 * (1.0 + q[2] * q[2]) * (v[0] * v[0] + v[1] * v[1]) - q[1] - 2.0 * q[2] * q[2] -
           0.5 * q[2] * q[0];
  });
  scene.constraints = {holonomic<3, 1>(
      []<class T>(const std::array<T, 3>& q) { return std::array<T, 1>{q[0] * q[0] + q[1] * q[1] - 1.0}; },
      {"circle"})};
  const double s = -0.5 / (4.0 - 0.81);
  scene.start = {0.0, Vector{{1.0, 0.0, s}}, Vector{{0.0, 0.9, 0.0}}};
  const LongReal s0 = -0.5L / (4 - LongReal(0.9) * LongReal(0.9));
  const LongVector end = extrapolated(
      [](LongReal, const LongVector& y) {
        const LongReal z = root(y[1], 0.5L * std::cos(y[0]));
        return LongVector{{y[1] / (1 + z * z), -std::cos(y[0]) + 0.5L * z * std::sin(y[0])}};
      },
      LongVector{{0.0L, LongReal(0.9) * (1 + s0 * s0)}}, 1.0L);
  const LongReal x = std::cos(end[0]), z = root(end[1], 0.5L * x);
  return {std::make_shared<const Scene>(scene), LongVector{{x, std::sin(end[0]), z}}.cast<double>()};
}

/// With a pair of first order beside it:  L = (1 + s²) v_x²/2 + z v_y − V.
inline DegenerateCase mixed_with_inner_coordinate() {
  Scene scene = scene_of("inner coordinate beside motions of first order", {"x", "y", "z", "s"});
  scene.lagrangian = lagrangian<4>([](const auto& q, const auto& v) {
    return 0.5 * (1.0 + q[3] * q[3]) * v[0] * v[0] + q[2] * v[1] -
           0.5 * (q[0] * q[0] + q[1] * q[1] + 1.5 * q[2] * q[2]) - 0.3 * q[0] * q[1] * q[2] -
           2.0 * q[3] * q[3] - q[3] * (0.5 * q[0] + 0.2 * q[1]);
  });
  const auto inner = [](const LongVector& y) { return root(y[3], 0.5L * y[0] + 0.2L * y[1]); };
  const LongVector start{{0.8L, 0.3L, -0.4L, 0.6L}};  // x, y, z, p_x
  const LongReal s = inner(start);
  scene.start = {0.0, LongVector{{start[0], start[1], start[2], s}}.cast<double>(),
                 LongVector{{start[3] / (1 + s * s), 0.0L, 0.0L, 0.0L}}.cast<double>()};
  const LongVector end = extrapolated(
      [&](LongReal, const LongVector& y) {
        const LongReal at = inner(y);
        return LongVector{{y[3] / (1 + at * at), 1.5L * y[2] + 0.3L * y[0] * y[1],
                           -y[1] - 0.3L * y[0] * y[2] - 0.2L * at, -y[0] - 0.3L * y[1] * y[2] - 0.5L * at}};
      },
      start, 1.0L);
  return {std::make_shared<const Scene>(scene),
          LongVector{{end[0], end[1], end[2], inner(end)}}.cast<double>()};
}

// A kernel that moves: p_2 = g(q_1) p_0.

template <class Q>
auto moving_potential(const Q& q) {
  return 0.5 * (q[0] * q[0] + q[1] * q[1]) + q[2] * q[2] + 0.3 * q[0] * q[2] + 0.2 * q[0] * q[1] * q[2];
}
inline LongVector moving_gradient(const LongVector& q) {
  return LongVector{{q[0] + 0.3L * q[2] + 0.2L * q[1] * q[2], q[1] + 0.2L * q[0] * q[2],
                     2 * q[2] + 0.3L * q[0] + 0.2L * q[0] * q[1]}};
}

/// q_2 that the hidden equation asks for.
template <class Hidden>
void solve_for_third(Hidden hidden, LongVector& y) {
  for (int k = 0; k < 60; ++k) {
    LongVector beside = y;
    beside[2] += 1e-6L;
    y[2] -= hidden(0.0L, y) * 1e-6L / (hidden(0.0L, beside) - hidden(0.0L, y));
  }
}

/// L = (v_0 + q_1 v_2)²/2 + v_1²/2 − V.
inline DegenerateCase moving_kernel() {
  Scene scene = scene_of("moving kernel", {"a", "b", "c"});
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v) {
    const auto w = v[0] + q[1] * v[2];
    return 0.5 * w * w + 0.5 * v[1] * v[1] - moving_potential(q);
  });
  const auto hidden = [](LongReal, const LongVector& y) {  // y = (q, p_0, p_1)
    const LongVector g = moving_gradient(y);
    return y[4] * y[3] - y[1] * g[0] + g[2];
  };
  const auto rate = [](LongReal, const LongVector& y, LongReal u) {
    const LongVector g = moving_gradient(y);
    return LongVector{{y[3] - y[1] * u, y[4], u, -g[0], -g[1] + y[3] * u}};
  };
  LongVector y{{0.7L, 0.4L, 0.1L, 0.5L, 0.3L}};
  solve_for_third(hidden, y);
  scene.start = {0.0, y.head(3).cast<double>(), LongVector{{y[3], y[4], 0.0L}}.cast<double>()};
  const LongVector end = extrapolated(
      [&](LongReal t, const LongVector& at) { return with_hidden_rate(rate, hidden, t, at); }, y, 1.0L);
  return {std::make_shared<const Scene>(scene), end.head(3).cast<double>()};
}

/// L = m (v_0 + g v_2)²/2 + v_1²/2 − V + q_0 sin(t)/5, g = sin q_1, m = 1 + q_1²/5, with friction against
/// v_0 + g v_2 and v_1, and `along` v_2 too, which makes the hidden equation one for v_2.
inline DegenerateCase moving_kernel_forced(double along) {
  Scene scene =
      scene_of(along > 0.0 ? "moving kernel, friction along it" : "moving kernel, forced", {"a", "b", "c"});
  scene.lagrangian =
      lagrangian<3>([]<class T>(const std::array<T, 3>& q, const std::array<T, 3>& v, const T& t) {
        using std::sin;
        const T w = v[0] + sin(q[1]) * v[2];
        return 0.5 * (1.0 + 0.2 * q[1] * q[1]) * w * w + 0.5 * v[1] * v[1] - moving_potential(q) +
               0.2 * sin(t) * q[0];
      });
  scene.force = force<3>([along]<class T>(const std::array<T, 3>& q, const std::array<T, 3>& v) {
    using std::sin;
    const T w = v[0] + sin(q[1]) * v[2];
    return std::array<T, 3>{-0.2 * w, -0.1 * v[1], -0.2 * sin(q[1]) * w - along * v[2]};
  });
  const auto mass = [](const LongVector& y) { return 1 + 0.2L * y[1] * y[1]; };
  const auto hidden = [](LongReal t, const LongVector& y) {  // y = (q, p_0, p_1)
    const LongVector g = moving_gradient(y);
    return std::cos(y[1]) * y[4] * y[3] + std::sin(y[1]) * (-g[0] + 0.2L * std::sin(t)) + g[2];
  };
  const auto rate = [mass](LongReal t, const LongVector& y, LongReal u) {
    const LongVector g = moving_gradient(y);
    const LongReal w = y[3] / mass(y);
    return LongVector{{w - std::sin(y[1]) * u, y[4], u, -g[0] - 0.2L * w + 0.2L * std::sin(t),
                       -g[1] + 0.2L * y[1] * w * w + y[3] * std::cos(y[1]) * u - 0.1L * y[4]}};
  };
  LongVector y{{0.7L, 0.4L, 0.1L, 0.5L, 0.3L}};
  if (along == 0.0) solve_for_third(hidden, y);
  scene.start = {0.0, y.head(3).cast<double>(), LongVector{{y[3] / mass(y), y[4], 0.0L}}.cast<double>()};
  const LongVector end = extrapolated(
      [&](LongReal t, const LongVector& at) {
        return along > 0.0 ? rate(t, at, -hidden(t, at) / along) : with_hidden_rate(rate, hidden, t, at);
      },
      y, 1.0L);
  return {std::make_shared<const Scene>(scene), end.head(3).cast<double>()};
}

/// L of moving_kernel() with v_3²/2, a potential q_3²/2 and a row v_3 = a v_1 + 0.3, a = 0.4 q_0.
inline DegenerateCase moving_kernel_with_row() {
  Scene scene = scene_of("moving kernel, nonholonomic", {"a", "b", "c", "d"});
  scene.lagrangian = lagrangian<4>([](const auto& q, const auto& v) {
    const auto w = v[0] + q[1] * v[2];
    return 0.5 * (w * w + v[1] * v[1] + v[3] * v[3]) - moving_potential(q) - 0.5 * q[3] * q[3];
  });
  scene.constraints = {affine<4, 1>(
      []<class T>(const std::array<T, 4>& q) {
        return std::array<std::array<T, 4>, 1>{{{T(0.0), -0.4 * q[0], T(0.0), T(1.0)}}};
      },
      []<class T>(const std::array<T, 4>&) { return std::array<T, 1>{T(-0.3)}; }, {"row"})};
  // y = (q_0 … q_3, p_0, P), P = p_1 + a p_3 = (1 + a²) v_1 + 0.3 a
  const auto speed = [](const LongVector& y) {
    const LongReal a = 0.4L * y[0];
    return (y[5] - 0.3L * a) / (1 + a * a);
  };
  const auto hidden = [speed](LongReal, const LongVector& y) {
    const LongVector g = moving_gradient(y);
    return speed(y) * y[4] - y[1] * g[0] + g[2];
  };
  const auto rate = [speed](LongReal, const LongVector& y, LongReal u) {
    const LongVector g = moving_gradient(y);
    const LongReal a = 0.4L * y[0], v1 = speed(y), v3 = a * v1 + 0.3L, v0 = y[4] - y[1] * u;
    return LongVector{{v0, v1, u, v3, -g[0], -g[1] + y[4] * u - a * y[3] + 0.4L * v0 * v3}};
  };
  LongVector y{{0.7L, 0.4L, 0.1L, -0.2L, 0.5L, 0.3L}};
  solve_for_third(hidden, y);
  const LongReal v1 = speed(y);
  scene.start = {0.0, y.head(4).cast<double>(),
                 LongVector{{y[4], v1, 0.0L, 0.4L * y[0] * v1 + 0.3L}}.cast<double>()};
  const LongVector end = extrapolated(
      [&](LongReal t, const LongVector& at) { return with_hidden_rate(rate, hidden, t, at); }, y, 1.0L);
  return {std::make_shared<const Scene>(scene), end.head(4).cast<double>()};
}

/// The same without the row and with q_1 = sin θ, q_3 = 1 − cos θ: a circle.
inline DegenerateCase moving_kernel_on_circle() {
  Scene scene = scene_of("moving kernel, holonomic", {"a", "b", "c", "d"});
  scene.lagrangian = lagrangian<4>([](const auto& q, const auto& v) {
    const auto w = v[0] + q[1] * v[2];
    return 0.5 * (w * w + v[1] * v[1] + v[3] * v[3]) - moving_potential(q) - 0.5 * q[3] * q[3];
  });
  scene.constraints = {holonomic<4, 1>(
      []<class T>(const std::array<T, 4>& q) {
        return std::array<T, 1>{q[1] * q[1] + (1.0 - q[3]) * (1.0 - q[3]) - 1.0};
      },
      {"circle"})};
  // y = (q_0, θ, q_2, p_0, θ')
  const auto place = [](const LongVector& y) { return LongVector{{y[0], std::sin(y[1]), y[2]}}; };
  const auto hidden = [place](LongReal, const LongVector& y) {
    const LongVector g = moving_gradient(place(y));
    return std::cos(y[1]) * y[4] * y[3] - std::sin(y[1]) * g[0] + g[2];
  };
  const auto rate = [place](LongReal, const LongVector& y, LongReal u) {
    const LongVector g = moving_gradient(place(y));
    const LongReal c = std::cos(y[1]), s = std::sin(y[1]);
    return LongVector{{y[3] - s * u, y[4], u, -g[0], (-g[1] + y[3] * u) * c - (1 - c) * s}};
  };
  LongVector y{{0.7L, 0.4L, 0.1L, 0.5L, 0.3L}};
  solve_for_third(hidden, y);
  const auto whole = [](const LongVector& at) {
    return LongVector{{at[0], std::sin(at[1]), at[2], 1 - std::cos(at[1])}};
  };
  scene.start = {0.0, whole(y).cast<double>(),
                 LongVector{{y[3], std::cos(y[1]) * y[4], 0.0L, std::sin(y[1]) * y[4]}}.cast<double>()};
  const LongVector end = extrapolated(
      [&](LongReal t, const LongVector& at) { return with_hidden_rate(rate, hidden, t, at); }, y, 1.0L);
  return {std::make_shared<const Scene>(scene), whole(end).cast<double>()};
}

inline const std::vector<DegenerateCase>& kernel_cases() {
  static const std::vector<DegenerateCase> cases{inner_coordinate(),
                                                 inner_coordinate_with_row(),
                                                 inner_coordinate_on_circle(),
                                                 mixed_with_inner_coordinate(),
                                                 moving_kernel(),
                                                 moving_kernel_forced(0.0),
                                                 moving_kernel_forced(0.3),
                                                 moving_kernel_with_row(),
                                                 moving_kernel_on_circle()};
  return cases;
}

}  // namespace diracstep::testing
