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

}  // namespace

bool keeps_energy(const Scene& scene) {
  return !scene.force && !depends_on_time(scene) &&
         std::ranges::none_of(scene.constraints,
                              [&](const auto& rows) { return is_driven(*rows, scene.start); });
}

std::string energy_doubt(const Scene& scene, const Sample& end) {
  if (!keeps_energy(scene)) return {};
  const double start = scene.energy(scene.start.time, scene.start.q, scene.start.v);
  Vector force(end.q.size()), momentum(end.q.size());
  scene.lagrangian->gradient(end.time, end.q, end.v, force, momentum);
  const double size = std::max({std::abs(start), 0.5 * std::abs(momentum.dot(end.v)),
                                end.q.lpNorm<Eigen::Infinity>() * force.lpNorm<Eigen::Infinity>()});
  const double change = end.energy - start;
  if (std::abs(change) <= doubtful_change * size) return {};  // false where one is not a number
  return fmt::format(
      "the energy, which this scene keeps, went from {:g} to {:g}: the step is too large to believe the "
      "result",
      start, end.energy);
}

}  // namespace diracstep
