#pragma once

#include <array>
#include <cmath>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>

/// Small non-linear scenes of each constraint class, on which the laws of a step are checked and orders
/// measured; none has a special symmetry.
namespace diracstep::laws {

/// A particle in space with a non-quadratic potential and a position-dependent mass.
struct Particle {
  template <class T>
  T operator()(const std::array<T, 3>& q, const std::array<T, 3>& v) const {
    using std::cos;
    return 0.5 * ((1.0 + 0.1 * q[0] * q[0]) * v[0] * v[0] + v[1] * v[1] + 2.0 * v[2] * v[2]) +
           0.2 * v[0] * v[1] * cos(q[2]) - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2]) -
           0.1 * q[0] * q[0] * q[2] * q[2];
  }
};

/// v_x + y v_z = 0.
struct Contact {
  template <class T>
  std::array<std::array<T, 3>, 1> operator()(const std::array<T, 3>& q) const {
    return {{{T(1.0), T(0.0), q[1]}}};
  }
};

/// v_x + (2 + y) v_z = 0, independent of the sphere's row along the motion of the mixed scene.
struct ShiftedContact {
  template <class T>
  std::array<std::array<T, 3>, 1> operator()(const std::array<T, 3>& q) const {
    return {{{T(1.0), T(0.0), 2.0 + q[1]}}};
  }
};

struct Sphere {
  template <class T>
  std::array<T, 1> operator()(const std::array<T, 3>& q) const {
    return {q[0] * q[0] + q[1] * q[1] + 0.5 * q[2] * q[2] - 1.5};
  }
};

inline Scene particle(const std::string& name) {
  Scene scene;
  scene.name = name;
  scene.coordinates = {"x", "y", "z"};
  scene.lagrangian = lagrangian<3>(Particle{});
  scene.start = {0.0, Vector(3), Vector(3)};
  scene.start.q << 1.0, 0.5, 0.7;
  scene.start.v << 0.3, -0.4, 0.6;
  return scene;
}

inline std::shared_ptr<const Scene> unconstrained() {
  return std::make_shared<const Scene>(particle("unconstrained"));
}

inline std::shared_ptr<const Scene> nonholonomic() {
  Scene scene = particle("nonholonomic");
  scene.constraints = {pfaffian<3, 1>(Contact{}, {"contact"})};
  scene.start.v[0] = -scene.start.q[1] * scene.start.v[2];
  return std::make_shared<const Scene>(scene);
}

inline std::shared_ptr<const Scene> holonomic_sphere() {
  Scene scene = particle("holonomic");
  scene.constraints = {holonomic<3, 1>(Sphere{}, {"sphere"})};
  scene.start.q << 1.0, 0.5, std::sqrt(0.5);
  scene.start.v << 0.3, -0.6, 0.0;  // q·(v with the metric of the sphere) = 0.3 − 0.3 = 0
  return std::make_shared<const Scene>(scene);
}

inline std::shared_ptr<const Scene> mixed() {
  Scene scene = particle("mixed");
  scene.constraints = {holonomic<3, 1>(Sphere{}, {"sphere"}), pfaffian<3, 1>(ShiftedContact{}, {"contact"})};
  const double x = 1.0, y = 0.5, z = std::sqrt(0.5);
  scene.start.q << x, y, z;
  scene.start.v << 2.0 * y * (2.0 + y), z - 2.0 * x * (2.0 + y),
      -2.0 * y;  // (2x, 2y, z) × (1, 0, 2+y), turned
  scene.start.v *= 0.15;
  return std::make_shared<const Scene>(scene);
}

/// Affine, time-dependent rows of both kinds and a driven Lagrangian.
inline std::shared_ptr<const Scene> driven() {
  Scene scene = particle("driven");
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v, const auto& t) {
    using std::cos, std::sin;
    return 0.5 * (1.0 + 0.2 * sin(t)) * (v[0] * v[0] + v[1] * v[1]) +
           0.5 * v[2] * v[2] * (1.0 + 0.1 * q[0] * q[0]) - 0.5 * q[1] * q[1] * (1.0 + q[2] * q[2]) * cos(t);
  });
  scene.constraints = {affine<3, 1>(
                           []<class T>(const std::array<T, 3>& q, const T& t) {
                             using std::sin;
                             return std::array<std::array<T, 3>, 1>{{{T(1.0), 0.5 * sin(t), q[1]}}};
                           },
                           []<class T>(const std::array<T, 3>& q, const T& t) {
                             using std::cos;
                             return std::array<T, 1>{0.3 * cos(2.0 * t) + 0.2 * q[2]};
                           }),
                       holonomic<3, 1>([]<class T>(const std::array<T, 3>& q, const T& t) {
                         using std::sin;
                         return std::array<T, 1>{q[2] + 0.3 * q[1] * q[1] - 0.5 * sin(t) - 0.8};
                       })};
  const double y = 0.5, z = 0.8 - 0.3 * y * y, vy = -0.4, vz = 0.5 - 0.6 * y * vy;
  scene.start.q << 1.0, y, z;
  scene.start.v << -(y * vz + 0.3 + 0.2 * z), vy, vz;
  return std::make_shared<const Scene>(scene);
}

/// A degenerate circuit: an inductor in series with two capacitors in parallel, both non-linear, and a
/// driving voltage in the loop that they form.  Charge going round that loop has no inertia.
inline std::shared_ptr<const Scene> degenerate_circuit() {
  Scene scene;
  scene.name = "degenerate circuit";
  scene.coordinates = {"qL", "q1", "q2"};
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v, const auto& t) {
    using std::sin;
    return 0.5 * v[0] * v[0] - 0.5 * q[1] * q[1] - 0.1 * q[1] * q[1] * q[1] * q[1] - 0.5 * q[2] * q[2] -
           q[2] * q[2] * q[2] / 15.0 + 0.3 * sin(t) * q[2];
  });
  scene.constraints = {pfaffian<3, 1>(
      []<class T>(const std::array<T, 3>&) {
        return std::array<std::array<T, 3>, 1>{{{T(1.0), T(-1.0), T(-1.0)}}};
      },
      {"node"})};
  scene.start = {0.0, Vector(3), Vector(3)};
  scene.start.q << 0.0, 0.5, 0.5;  // 0.5 + 0.4/8 = 0.5 + 0.2/4
  scene.start.v << 0.3, 0.3, 0.0;
  return std::make_shared<const Scene>(scene);
}

/// A force that depends on q and v and is no gradient.
struct Drag {
  template <class T>
  std::array<T, 3> operator()(const std::array<T, 3>& q, const std::array<T, 3>& v) const {
    return {-0.3 * v[0] * v[0] + 0.2 * q[1], -0.4 * v[1] * q[0], 0.1 * v[0] - 0.2 * v[2]};
  }
};

/// The same scene under that force.
inline std::shared_ptr<const Scene> forced(const std::shared_ptr<const Scene>& scene) {
  Scene copy = *scene;
  copy.name += ", forced";
  copy.force = force<3>(Drag{});
  return std::make_shared<const Scene>(copy);
}

/// Lotka–Volterra, a phase-space Lagrangian θ(q)·v − H(q) in a gauge where no component of θ vanishes; data
/// of JuliaGNI/GeometricProblems.jl, src/lotka_volterra_2d.jl.
inline std::shared_ptr<const Scene> phase_space() {
  Scene scene;
  scene.name = "phase space";
  scene.coordinates = {"prey", "predators"};
  scene.lagrangian = lagrangian<2>([](const auto& q, const auto& v) {
    using std::log;
    return (q[1] + log(q[1]) / q[0]) * v[0] + q[0] * v[1] + q[0] + q[1] - log(q[0]) - 2.0 * log(q[1]);
  });
  scene.start = {0.0, Vector(2), Vector(2)};
  scene.start.q << 2.0, 1.0;
  scene.start.v << 2.0, 1.0;
  return std::make_shared<const Scene>(scene);
}

inline const std::array<std::shared_ptr<const Scene>, 4>& every_constraint_class() {
  static const std::array<std::shared_ptr<const Scene>, 4> scenes{unconstrained(), nonholonomic(),
                                                                  holonomic_sphere(), mixed()};
  return scenes;
}

}  // namespace diracstep::laws
