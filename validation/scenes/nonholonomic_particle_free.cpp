#include <cmath>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/validation/scenes/scenes.hpp>

namespace diracstep::scenes {

namespace {

struct FreeParticle {
  template <class T>
  T operator()(const std::array<T, 3>&, const std::array<T, 3>& v) const {
    return 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  }
};

/// v_z − y v_x = 0.
struct Rosenberg {
  template <class T>
  std::array<std::array<T, 3>, 1> operator()(const std::array<T, 3>& q) const {
    return {{{-q[1], T(0.0), T(1.0)}}};
  }
};

}  // namespace

CatalogueScene nonholonomic_particle_free(const Parameters&) {
  Scene scene;
  scene.name = "nonholonomic_particle_free";
  scene.coordinates = {"x", "y", "z"};
  scene.lagrangian = lagrangian<3>(FreeParticle{});
  scene.constraints = {pfaffian<3, 1>(Rosenberg{}, {"rosenberg"})};
  scene.start = {0.0, Vector::Zero(3), Vector::Zero(3)};
  scene.start.v << 1.0, 1.0, 0.0;

  CatalogueScene entry;
  entry.scene = std::make_shared<const Scene>(std::move(scene));
  entry.kind = "nonholonomic";
  entry.description = "Free particle in space with v_z = y v_x";
  entry.source = "Bates-Sniatycki and Rosenberg particle, as in Cortes and Martinez; closed form";
  entry.t_end = 10.0;
  entry.natural_step = 0.25;
  entry.reference = {"exact", "x = asinh t, y = t, z = sqrt(1+t^2) - 1", 1e-15, [](double t) {
                       const double r = std::sqrt(1.0 + t * t);
                       ReferencePoint point{Vector(3), Vector(3)};
                       point.q << std::asinh(t), t, t * t / (1.0 + r);
                       point.v << 1.0 / r, 1.0, t / r;
                       return std::optional(point);
                     }};
  return entry;
}

}  // namespace diracstep::scenes
