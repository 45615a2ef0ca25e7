#include <cmath>
#include <diracstep/constraints/pfaffian.hpp>
#include <diracstep/core/errors.hpp>
#include <diracstep/validation/scenes/scenes.hpp>

namespace diracstep::scenes {

namespace {

struct Skate {
  double m, j, slope;
  template <class T>
  T operator()(const std::array<T, 3>& q, const std::array<T, 3>& v) const {
    return 0.5 * m * (v[0] * v[0] + v[1] * v[1]) + 0.5 * j * v[2] * v[2] + m * slope * q[0];
  }
};

/// v_x sin(ph) − v_y cos(ph) = 0: no sliding across the blade.
struct Blade {
  template <class T>
  std::array<std::array<T, 3>, 1> operator()(const std::array<T, 3>& q) const {
    using std::cos, std::sin;
    return {{{sin(q[2]), -cos(q[2]), T(0.0)}}};
  }
};

}  // namespace

CatalogueScene knife_edge(const Parameters& parameters) {
  const double m = parameters.at("m"), j = parameters.at("J"), slope = parameters.at("g_sin_alpha");
  if (!(m > 0.0 && j > 0.0)) throw Misuse("scene 'knife_edge': m and J must be positive");
  Scene scene;
  scene.name = "knife_edge";
  scene.coordinates = {"x", "y", "ph"};
  scene.lagrangian = lagrangian<3>(Skate{m, j, slope});
  scene.constraints = {pfaffian<3, 1>(Blade{}, {"blade"})};
  scene.start = {0.0, Vector::Zero(3), Vector::Zero(3)};
  scene.start.v[2] = 1.0;

  CatalogueScene entry;
  entry.scene = std::make_shared<const Scene>(std::move(scene));
  entry.kind = "nonholonomic";
  entry.description = "Skate on an inclined plane, x down the slope, heading ph turning at unit rate";
  entry.source = "Neimark and Fufaev p. 108; Bloch, Nonholonomic Mechanics and Control, 1.6; closed form";
  entry.t_end = 10.0;
  entry.natural_step = 0.25;
  entry.reference = {"exact", "x = s sin(t)^2/2, y = s (t - sin(2t)/2)/2 with s = g sin(alpha)", 1e-15,
                     [slope](double t) {
                       const double s = std::sin(t), c = std::cos(t);
                       ReferencePoint point{Vector(3), Vector(3)};
                       point.q << slope * s * s / 2.0, slope * (t - s * c) / 2.0, t;
                       point.v << slope * s * c, slope * s * s, 1.0;
                       return std::optional(point);
                     }};
  return entry;
}

}  // namespace diracstep::scenes
