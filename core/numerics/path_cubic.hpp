#pragma once

#include <array>
#include <diracstep/core/numerics/types.hpp>

namespace diracstep {

/// Places within a part of length 1, and weights, of an integral over it: a force that is odd about the
/// middle is not taken for none.
struct GaussPoint {
  double place, weight;
};
constexpr std::array<GaussPoint, 3> gauss_points{
    {{0.1127016653792583, 5.0 / 18.0}, {0.5, 8.0 / 18.0}, {0.8872983346207417, 5.0 / 18.0}}};

/// A point of a run: what it steps over is looked for between such points.
struct PathPoint {
  double time;
  Vector q, v;
  Vector p = {};  ///< looked at where the scene is given by a Hamiltonian alone
};

/// The cubic with the positions and velocities of two points.
struct PathCubic {
  const PathPoint &from, &to;

  double begin() const { return from.time; }
  double end() const { return to.time; }
  void at(double t, Vector& q, Vector& v) const {
    const double h = end() - begin(), s = (t - begin()) / h, r = 1.0 - s;
    q = (1.0 + 2.0 * s) * r * r * from.q + s * r * r * h * from.v + s * s * (1.0 + 2.0 * r) * to.q -
        s * s * r * h * to.v;
    v = 6.0 * s * r / h * (to.q - from.q) + r * (1.0 - 3.0 * s) * from.v + s * (3.0 * s - 2.0) * to.v;
  }
  /// Momenta in between, on a straight line.
  void momentum_at(double t, Vector& p) const {
    p = from.p;
    if (p.size() > 0) p += (t - begin()) / (end() - begin()) * (to.p - from.p);
  }
};

}  // namespace diracstep
