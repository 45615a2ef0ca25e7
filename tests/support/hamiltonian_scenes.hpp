#pragma once

#include <cmath>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/system/scene.hpp>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <utility>

namespace diracstep::testing {

/// A scene given by a Hamiltonian alone, and its motion in closed form: (q, p) at a time.
struct HamiltonianCase {
  std::shared_ptr<const Scene> scene;
  std::function<std::pair<Vector, Vector>(double t)> at;
};

template <int N, class H>
Scene scene_of_hamiltonian(const std::string& name, H formula, const Vector& q, const Vector& p) {
  Scene scene;
  scene.name = name;
  for (int i = 0; i < N; ++i) scene.coordinates.push_back("q" + std::to_string(i));
  scene.hamiltonian = hamiltonian<N>(formula);
  scene.start = {0.0, q, Vector(), p};
  return scene;
}

/// H = p0 q1 − p1 q0 + q0²/10, linear in p: q turns, and p is the momentum of a resonance.
inline HamiltonianCase linear_in_p() {
  const double a = 0.3, b = -0.7;
  const auto at = [=](double t) {
    const double s = std::sin(t), c = std::cos(t);
    return std::pair{Vector{{c, -s}},
                     Vector{{a * s - b * c - 0.1 * (s + t * c), a * c + b * s + 0.1 * t * s}}};
  };
  const auto [q, p] = at(0.0);
  return {
      std::make_shared<const Scene>(scene_of_hamiltonian<2>(
          "linear in p",
          [](const auto& x, const auto& y) { return y[0] * x[1] - y[1] * x[0] + 0.1 * x[0] * x[0]; }, q, p)),
      at};
}

/// H = 1 − cos p − q: p grows through π/2, where ∂²H/∂p² vanishes and turns negative.
inline HamiltonianCase band() {
  const auto at = [](double t) { return std::pair{Vector{{1.0 - std::cos(t)}}, Vector{{t}}}; };
  return {std::make_shared<const Scene>(scene_of_hamiltonian<1>(
              "band",
              [](const auto& x, const auto& y) {
                using std::cos;
                return 1.0 - cos(y[0]) - x[0];
              },
              Vector{{0.0}}, Vector{{0.0}})),
          at};
}

/// Two point vortices of circulations 4 and 2 at unit distance in the canonical coordinates q_i = y_i and
/// p_i = g_i x_i, of a Hamiltonian without kinetic energy: rigid rotation at (g1 + g2)/(2π).
inline HamiltonianCase vortices() {
  const double g1 = 4.0, g2 = 2.0, w = (g1 + g2) / (2.0 * std::numbers::pi), r1 = g2 / (g1 + g2),
               r2 = g1 / (g1 + g2);
  const auto at = [=](double t) {
    const double s = std::sin(w * t), c = std::cos(w * t);
    return std::pair{Vector{{r1 * s, -r2 * s}}, Vector{{g1 * r1 * c, -g2 * r2 * c}}};
  };
  const auto [q, p] = at(0.0);
  return {std::make_shared<const Scene>(scene_of_hamiltonian<2>(
              "vortices",
              [=](const auto& x, const auto& y) {
                using std::log;
                const auto dx = y[0] / g1 - y[1] / g2, dy = x[0] - x[1];
                return g1 * g2 * log(dx * dx + dy * dy) / (4.0 * std::numbers::pi);
              },
              q, p)),
          at};
}

/// A relativistic charge in a magnetic field B: γ is kept, and the kinetic momentum turns at B/γ.
inline HamiltonianCase relativistic_charge() {
  const double field = 1.5, k = 0.8, gamma = std::sqrt(1.0 + k * k), w = field / gamma, r = k / field;
  const auto at = [=](double t) {
    const double s = std::sin(w * t), c = std::cos(w * t);  // about the origin, clockwise
    const Vector q{{r * s, r * c}}, kinetic{{k * c, -k * s}};
    return std::pair{q, Vector(kinetic + 0.5 * field * Vector{{-q[1], q[0]}})};
  };
  const auto [q, p] = at(0.0);
  return {std::make_shared<const Scene>(scene_of_hamiltonian<2>(
              "relativistic charge",
              [=](const auto& x, const auto& y) {
                using std::sqrt;
                const auto a = y[0] + 0.5 * field * x[1], b = y[1] - 0.5 * field * x[0];
                return sqrt(1.0 + a * a + b * b);
              },
              q, p)),
          at};
}

/// A skate on a slope whose heading q2 turns at a given rate, H = (p0² + p1²)/2 + g q0 + ω p2: degenerate in
/// p2, with the row sin q2 v0 = cos q2 v1.  Along the blade u' = −g cos q2; Λ = g sin q2 − u ω.
inline HamiltonianCase turning_skate() {
  const double g = 0.6, w = 1.3, u0 = 0.9;
  const auto at = [=](double t) {
    const double s = std::sin(w * t), c = std::cos(w * t), u = u0 - g / w * s;
    const Vector q{{u0 * s / w - g * s * s / (2.0 * w * w),
                    u0 * (1.0 - c) / w - g / w * (0.5 * t - std::sin(2.0 * w * t) / (4.0 * w)), w * t}};
    return std::pair{q, Vector{{u * c, u * s, 0.4}}};
  };
  const auto [q, p] = at(0.0);
  Scene scene = scene_of_hamiltonian<3>(
      "turning skate",
      [=](const auto& x, const auto& y) { return 0.5 * (y[0] * y[0] + y[1] * y[1]) + g * x[0] + w * y[2]; },
      q, p);
  scene.constraints = {pfaffian<3, 1>(
      []<class T>(const std::array<T, 3>& x) {
        using std::cos, std::sin;
        return std::array<std::array<T, 3>, 1>{{{sin(x[2]), -cos(x[2]), T(0.0)}}};
      },
      {"blade"})};
  return {std::make_shared<const Scene>(scene), at};
}

/// A bead on the unit circle under a force along it that turns with a clock q2 of rate ω,
/// H = (p0² + p1²)/2 + ω p2: the angle obeys θ'' = τ cos ωt.
inline HamiltonianCase driven_bead() {
  const double torque = 0.8, w = 1.7, turn = 0.5;
  const auto at = [=](double t) {
    const double angle = turn * t + torque * (1.0 - std::cos(w * t)) / (w * w),
                 rate = turn + torque * std::sin(w * t) / w;
    const double s = std::sin(angle), c = std::cos(angle);
    return std::pair{Vector{{c, s, w * t}}, Vector{{-rate * s, rate * c, 0.0}}};
  };
  const auto [q, p] = at(0.0);
  Scene scene = scene_of_hamiltonian<3>(
      "driven bead", [=](const auto&, const auto& y) { return 0.5 * (y[0] * y[0] + y[1] * y[1]) + w * y[2]; },
      q, p);
  scene.constraints = {holonomic<3, 1>(
      []<class T>(const std::array<T, 3>& x) { return std::array<T, 1>{x[0] * x[0] + x[1] * x[1] - 1.0}; },
      {"circle"})};
  scene.force = force<3>([=]<class T>(const std::array<T, 3>& x, const std::array<T, 3>&) {
    using std::cos;
    const T f = torque * cos(x[2]);
    return std::array<T, 3>{-f * x[1], f * x[0], T(0.0)};
  });
  return {std::make_shared<const Scene>(scene), at};
}

}  // namespace diracstep::testing
