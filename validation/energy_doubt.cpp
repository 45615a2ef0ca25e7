#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/validation/energy_doubt.hpp>

namespace diracstep {

namespace {

constexpr double doubtful_change = 0.1;

bool depends_on_time(const Scene& scene) {
  const auto& [t, q, v, p] = scene.start;
  return scene.lagrangian->value(t, q, v) != scene.lagrangian->value(t + 1.0, q, v);
}

bool is_driven(const ConstraintRows& rows, const Start& start) {
  Vector a(rows.pattern().nonzeros()), b(rows.rows());
  rows.coefficients(start.time, start.q, a, b);
  return (b.array() != 0.0).any();
}

/// The kinetic energy |p·v|/2 and |q|∞ |∂L/∂q|∞, two energies at play at a point.
struct Sizes {
  double kinetic, work;
};

Sizes sizes(const Scene& scene, double t, ConstVectorRef q, ConstVectorRef v) {
  Vector force(q.size()), momentum(q.size());
  scene.lagrangian->gradient(t, q, v, force, momentum);
  return {0.5 * std::abs(momentum.dot(v)), q.lpNorm<Eigen::Infinity>() * force.lpNorm<Eigen::Infinity>()};
}

}  // namespace

bool keeps_energy(const Scene& scene) {
  return !scene.force && !depends_on_time(scene) &&
         std::ranges::none_of(scene.constraints,
                              [&](const auto& rows) { return is_driven(*rows, scene.start); });
}

std::string energy_doubt(const Scene& scene, const Sample& end) {
  if (!keeps_energy(scene)) return {};
  const auto& [t, q, v, p] = scene.start;
  const double start = scene.energy(t, q, v);
  const Sizes before = sizes(scene, t, q, v), after = sizes(scene, end.time, end.q, end.v);
  // The smaller of two: a run that blows up is not measured by its own size.
  double size =
      std::max({std::abs(start), std::min(before.kinetic, after.kinetic), std::min(before.work, after.work)});
  if (size == 0.0) size = std::max(after.kinetic, after.work);
  if (std::abs(end.energy - start) <= doubtful_change * size) return {};  // false where one is not a number
  return fmt::format(
      "the energy, which this scene keeps, went from {:g} to {:g}: the step is too large to believe the "
      "result",
      start, end.energy);
}

}  // namespace diracstep
