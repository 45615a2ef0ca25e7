#include <array>
#include <cmath>
#include <diracstep/constraints/holonomic.hpp>
#include <diracstep/core/errors.hpp>
#include <diracstep/validation/scenes/scenes.hpp>
#include <numbers>

namespace diracstep::scenes {

namespace {

struct PointMass {
  double g;
  template <class T>
  T operator()(const std::array<T, 2>& q, const std::array<T, 2>& v) const {
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) - g * q[1];
  }
};

struct Rod {
  template <class T>
  std::array<T, 1> operator()(const std::array<T, 2>& q) const {
    return {q[0] * q[0] + q[1] * q[1] - 1.0};
  }
};

struct Jacobi {
  long double sn, cn, dn;
};

/// The Jacobi elliptic functions of modulus k = sqrt(1/2), by the arithmetic-geometric mean.
Jacobi jacobi(long double u) {
  constexpr std::size_t levels = 7;
  std::array<long double, levels> a{1.0L}, c{std::sqrt(0.5L)};
  long double b = std::sqrt(0.5L), scale = 1.0L;
  for (std::size_t i = 1; i < levels; ++i, scale *= 2.0L) {
    a[i] = (a[i - 1] + b) / 2.0L;
    c[i] = (a[i - 1] - b) / 2.0L;
    b = std::sqrt(a[i - 1] * b);
  }
  const long double turn = 2.0L * std::numbers::pi_v<long double>;
  const long double quarter_period = std::numbers::pi_v<long double> / (2.0L * a[levels - 1]);
  u = std::remainder(u, 4.0L * quarter_period);
  long double angle = std::remainder(scale * a[levels - 1] * u, scale * turn);
  for (std::size_t i = levels - 1; i > 0; --i)
    angle = (angle + std::asin(c[i] / a[i] * std::sin(angle))) / 2.0L;
  const long double sn = std::sin(angle);
  return {sn, std::cos(angle), std::sqrt(1.0L - sn * sn / 2.0L)};
}

/// Released at rest from the horizontal: sin(half the angle from the downward vertical) = k cd(√g t).
ReferencePoint swing(double t, double gravity) {
  const long double k = std::sqrt(0.5L), w = std::sqrt(static_cast<long double>(gravity));
  const auto [sn, cn, dn] = jacobi(w * t);
  const long double half_sine = k * cn / dn, half_cosine = std::sqrt(1.0L - half_sine * half_sine);
  const long double rate = -w * sn / (dn * dn) * k / half_cosine;  // of the angle; 1 − k² = 1/2
  const long double s = 2.0L * half_sine * half_cosine, c = 1.0L - 2.0L * half_sine * half_sine;
  ReferencePoint point{Vector(2), Vector(2)};
  point.q << static_cast<double>(s), static_cast<double>(-c);
  point.v << static_cast<double>(c * rate), static_cast<double>(s * rate);
  return point;
}

}  // namespace

CatalogueScene pendulum_cartesian(const Parameters& parameters) {
  const double g = parameters.at("g");
  if (!(g > 0.0)) throw Misuse("scene 'pendulum_cartesian': g = " + std::to_string(g) + " must be positive");
  Scene scene;
  scene.name = "pendulum_cartesian";
  scene.coordinates = {"x", "y"};
  scene.lagrangian = lagrangian<2>(PointMass{g});
  scene.constraints = {holonomic<2, 1>(Rod{}, {"rod"})};
  scene.start = {0.0, Vector::Zero(2), Vector::Zero(2)};
  scene.start.q[0] = 1.0;

  CatalogueScene entry;
  entry.scene = std::make_shared<const Scene>(std::move(scene));
  entry.kind = "holonomic";
  entry.description = "Planar pendulum in Cartesian coordinates, released from the horizontal; period 2";
  entry.source = "SUNDIALS examples/cvode/serial/cvPendulum_dns.c; closed form";
  entry.t_end = 29.7;
  entry.natural_step = 0.05;
  entry.reference = {"exact", "Jacobi elliptic functions of modulus sqrt(1/2)", 1e-15,
                     [g](double t) { return std::optional(swing(t, g)); }};
  return entry;
}

}  // namespace diracstep::scenes
