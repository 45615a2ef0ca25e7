#include <cmath>
#include <diracstep/core/errors.hpp>
#include <diracstep/validation/scenes/scenes.hpp>
#include <numbers>

namespace diracstep::scenes {

namespace {

struct Kepler {
  template <class T>
  T operator()(const std::array<T, 2>& q, const std::array<T, 2>& v) const {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) + 1.0 / sqrt(q[0] * q[0] + q[1] * q[1]);
  }
};

/// E − e sin E = t, solved in extended precision.
long double eccentric_anomaly(double t, long double e) {
  const long double turn = 2.0L * std::numbers::pi_v<long double>;
  const long double mean = std::remainder(static_cast<long double>(t), turn);
  long double anomaly = mean < 0.0L ? mean - e / 2.0L : mean + e / 2.0L;
  for (int i = 0; i < 60; ++i) {
    const long double change =
        (anomaly - e * std::sin(anomaly) - mean) / (1.0L - e * std::cos(anomaly));
    anomaly -= change;
    if (std::abs(change) < 1e-19L) break;
  }
  return anomaly;
}

ReferencePoint on_the_orbit(double t, double eccentricity) {
  const long double e = eccentricity, b = std::sqrt(1.0L - e * e);
  const long double anomaly = eccentric_anomaly(t, e);
  const long double s = std::sin(anomaly), c = std::cos(anomaly), rate = 1.0L / (1.0L - e * c);
  Vector q(2), v(2);
  q << static_cast<double>(c - e), static_cast<double>(b * s);
  v << static_cast<double>(-s * rate), static_cast<double>(b * c * rate);
  return {q, v};
}

}  // namespace

CatalogueScene kepler(const Parameters& parameters) {
  const double e = parameters.at("e");
  if (!(e >= 0.0 && e < 1.0))
    throw Misuse("scene 'kepler_e06': the eccentricity e = " + std::to_string(e) + " must lie in [0, 1)");
  Scene scene;
  scene.name = "kepler_e06";
  scene.coordinates = {"x", "y"};
  scene.lagrangian = lagrangian<2>(Kepler{});
  scene.start = {0.0, Vector::Zero(2), Vector::Zero(2)};
  scene.start.q[0] = 1.0 - e;
  scene.start.v[1] = std::sqrt((1.0 + e) / (1.0 - e));

  CatalogueScene entry;
  entry.scene = std::make_shared<const Scene>(std::move(scene));
  entry.kind = "unconstrained";
  entry.description = "Planar two-body problem, semi-major axis 1, start at pericentre";
  entry.source = "SUNDIALS examples/arkode/C_serial/ark_kepler.c; Hairer, Lubich, Wanner, GNI I.2; closed form";
  entry.t_end = 200.0;
  entry.natural_step = 0.05;
  entry.reference = {"exact", "x = cos E - e, y = sqrt(1-e^2) sin E with E - e sin E = t", 1e-15,
                     [e](double t) { return std::optional(on_the_orbit(t, e)); }};
  return entry;
}

}  // namespace diracstep::scenes
