#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/energy_check.hpp>
#include <sstream>

namespace diracstep {

namespace {

constexpr double doubted = 0.1;
constexpr long points_for_a_mean = 32;

}  // namespace

bool keeps_energy(const Scene& scene) {
  return !scene.force && scene.stepped_function().structure().autonomous &&
         std::ranges::all_of(scene.constraints, [](const auto& rows) { return rows->workless(); });
}

EnergyCheck::EnergyCheck(const Scene& scene, bool damped)
    : scene_(scene),
      keeps_energy_(keeps_energy(scene)),
      damped_(damped),
      rest_(scene),
      force_(Vector::Zero(scene.dimension())),
      momentum_(force_) {}

void EnergyCheck::see(const Sample& point) {
  if (!keeps_energy_ || !(worst_change_ < HUGE_VAL)) return;
  if (start_position_.size() == 0) {
    start_energy_ = point.energy;
    start_position_ = point.q;
    rest_.see(point);
    last_time_ = point.time;
  }
  longest_time_ = std::max(longest_time_, std::abs(point.time - last_time_));
  last_time_ = point.time;
  const double way = max_norm(point.q - start_position_);
  // At rest what moves is round-off, and so are the energies at play.
  const double size = std::max(max_norm(start_position_), longest_time_ * rest_.speed(longest_time_));
  if (std::isfinite(point.energy) && way <= at_rest * size) return;
  add_at_play(point);
  double change = std::abs(point.energy - start_energy_);
  if (!std::isfinite(change)) change = HUGE_VAL;
  if (change > worst_change_) {
    worst_change_ = change;
    worst_energy_ = point.energy;
    worst_time_ = point.time;
  }
  if (points_ >= points_for_a_mean) lost_ = lost_ || too_large(mean_at_play());
}

void EnergyCheck::add_at_play(const Sample& point) {
  scene_.force_and_momentum(point.time, point.q, point.v, point.p, force_, momentum_);
  const double kinetic = 0.5 * std::abs(momentum_.dot(point.v)),
               work = scene_.space ? max_norm(force_) * max_norm(point.q - start_position_)
                                   : std::abs(force_.dot(point.q - start_position_));
  double here = 0.0;
  for (const double size : {kinetic, damped_ ? 0.0 : work})
    if (std::isfinite(size)) here = std::max(here, size);
  at_play_ = std::max(at_play_, here);
  sum_at_play_ += here;
  ++points_;
}

bool EnergyCheck::too_large(double at_play) const {
  const double rounding = at_rest * std::max(std::abs(start_energy_), rest_.energy(longest_time_));
  return worst_change_ > std::max(doubted * at_play, rounding);
}

std::string EnergyCheck::denied(const Sample& point, double error, double position_size,
                                double momentum_size) {
  if (!keeps_energy_ || start_position_.size() == 0) return {};
  scene_.force_and_momentum(point.time, point.q, point.v, point.p, force_, momentum_);
  const double terms = momentum_size * point.v.cwiseAbs().sum() + position_size * force_.cwiseAbs().sum();
  const double rounding = at_rest * std::max({std::abs(start_energy_), std::abs(point.energy), terms});
  const double change = std::abs(point.energy - start_energy_);
  if (!(change > 2.0 * error * terms + rounding)) return {};
  std::ostringstream text;
  text << "the energy, which this scene keeps, went from " << start_energy_ << " to " << point.energy
       << ", by " << change << ": an error of " << error << " allows " << error * terms
       << ", so that the runs agree on a wrong motion; forces may change fast where it goes";
  return text.str();
}

std::string EnergyCheck::text() const {
  if (!lost_ && !(points_ < points_for_a_mean && too_large(at_play_))) return {};
  std::ostringstream text;
  text
      << "the energy, which this scene keeps, went from " << start_energy_ << " to " << worst_energy_
      << " at t = " << worst_time_
      << (damped_ && worst_energy_ < start_energy_
              ? ": the method damps what its steps do not resolve; a smaller step or a method that keeps the "
                "energy if that matters here"
              : ": the step is too large for the result to be trusted");
  return text.str();
}

}  // namespace diracstep
