#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/energy_check.hpp>
#include <sstream>

namespace diracstep {

namespace {

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

EnergyCheck::EnergyCheck(const Scene& scene)
    : scene_(scene),
      keeps_energy_(keeps_energy(scene)),
      force_(Vector::Zero(scene.dimension())),
      momentum_(force_) {}

EnergyCheck::Sizes EnergyCheck::sizes(double t, ConstVectorRef q, ConstVectorRef v) {
  scene_.lagrangian->gradient(t, q, v, force_, momentum_);
  return {0.5 * std::abs(momentum_.dot(v)), max_norm(q) * max_norm(force_)};
}

void EnergyCheck::see(const Sample& point) {
  if (!keeps_energy_) return;
  if (start_position_.size() == 0) {
    start_energy_ = point.energy;
    start_sizes_ = sizes(point.time, point.q, point.v);
    start_position_ = point.q;
  }
  // At rest what moves is round-off, and so are the energies at play.
  const double way = max_norm(point.q - start_position_);
  if (std::isfinite(point.energy) && way <= at_rest * max_norm(start_position_)) return;
  const Sizes now = sizes(point.time, point.q, point.v);
  // The smaller of two: a run that blows up is not measured by its own size.
  double size = std::max({std::abs(start_energy_), std::min(start_sizes_.kinetic, now.kinetic),
                          std::min(start_sizes_.work, now.work)});
  if (size == 0.0) size = std::max(now.kinetic, now.work);
  const double change = std::abs(point.energy - start_energy_);
  if (change <= worst_ * size) return;  // false where one is not a number
  worst_ = change / size;
  std::ostringstream text;
  text << "the energy, which this scene keeps, went from " << start_energy_ << " to " << point.energy
       << " at t = " << point.time << ": the step is too large to believe the result";
  text_ = text.str();
}

}  // namespace diracstep
