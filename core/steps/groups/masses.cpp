#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/kernel_basis.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/steps/groups/masses.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/lagrangian_derivatives.hpp>
#include <limits>
#include <string>

namespace diracstep {

namespace {

/// In the units in which the diagonal is 1, as far as it is not 0.
Vector units_of(const Columns& mass) {
  Vector units = mass.diagonal().cwiseAbs().cwiseSqrt();
  for (double& unit : units) unit = 1.0 / size_or_one(unit);
  return units;
}

/// Velocities that the rows allow at the start, as columns in those units.
Columns allowed_velocities(const Scene& scene, const Vector& units) {
  constexpr double dependent = 1e-10;
  if (scene.rows() == 0) return Columns::Identity(units.size(), units.size());
  ConstraintsAtPoint rows(scene.constraints, scene.dimension());
  rows.evaluate(scene.start.time, scene.start.q);
  return kernel_basis(rows.pattern().full(rows.coefficients()) * units.asDiagonal(), dependent);
}

std::string named(const Scene& scene, const Vector& direction) {
  constexpr double shown = 1e-6;  // of the largest
  std::string text;
  for (Eigen::Index i = 0; i < direction.size(); ++i)
    if (std::abs(direction[i]) > shown * max_norm(direction))
      text += (text.empty() ? "" : ", ") + scene.coordinates[static_cast<std::size_t>(i)];
  return text;
}

}  // namespace

void require_masses(const Scene& scene) {
  const Start& start = scene.start;
  const int n = scene.dimension();
  const Vector v = start.v.size() == n ? start.v : Vector(Vector::Zero(n));
  LagrangianDerivatives l(*scene.lagrangian);
  l.take_second(*scene.lagrangian, start.time, start.q, v);
  const Columns mass = scene.lagrangian->pattern().full(l.vv);
  if (!mass.allFinite()) return;
  const Vector units = units_of(mass);
  const Columns allowed = allowed_velocities(scene, units);
  if (allowed.cols() == 0) return;
  const Columns along = allowed.transpose() * units.asDiagonal() * mass * units.asDiagonal() * allowed;
  constexpr double round_off = 16.0 * std::numeric_limits<double>::epsilon();
  const Columns kernel = max_norm(along) > 0.0 ? kernel_basis(along, round_off * static_cast<double>(n))
                                               : Columns(Columns::Identity(along.rows(), along.cols()));
  if (kernel.cols() == 0) return;
  const Vector direction = units.asDiagonal() * (allowed * kernel.col(0));
  throw Misuse("scene '" + scene.name + "' on " + scene.space->name() +
               ": its Lagrangian has no mass along velocities of " + named(scene, direction) +
               " that the rows allow; such motions of first order are known in R^n only");
}

}  // namespace diracstep
