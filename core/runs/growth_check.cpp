#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/growth_check.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <limits>
#include <sstream>

namespace diracstep {

namespace {

constexpr long most_steps_followed = 1000;
constexpr int most_followed = 12;  // coordinates and rows
constexpr double growth_of_no_power = 1e4, too_uncertain = 0.02;

}  // namespace

Start beside(const Start& start, double position_size, double velocity_size) {
  Start moved = start;
  for (Eigen::Index i = 0; i < moved.q.size(); ++i)
    moved.q[i] += distance_beside * position_size * std::sin(1.0 + 1.7 * static_cast<double>(i));
  for (Eigen::Index i = 0; i < moved.v.size(); ++i)
    moved.v[i] += distance_beside * velocity_size * std::cos(0.4 + 1.3 * static_cast<double>(i));
  return moved;
}

GrowthCheck::GrowthCheck(const Integrator& integrator, long steps)
    : steps_(steps),
      watched_(integrator.work().steps == 0 && steps <= most_steps_followed &&
               integrator.scene().dimension() + integrator.scene().rows() <= most_followed) {}

void GrowthCheck::see(const Sample& point) {
  if (!watched_) return;
  if (first_.q.size() == 0) first_ = {point.time, point.q, point.v, {}};
  way_ = std::max(way_, max_norm(point.q - first_.q));
  largest_momentum_ = std::max(largest_momentum_, max_norm(point.p));
  largest_velocity_ = std::max(largest_velocity_, max_norm(point.v));
}

void GrowthCheck::finish(Integrator& integrator, double local) {
  if (!watched_ || integrator.work().steps != steps_ || !(way_ > 0.0) || !(largest_momentum_ > 0.0)) return;
  Sample end, other;
  if (!integrator.sample(Momentum::projected, end).ok()) return;
  const Snapshot state = integrator.save();
  bool followed = true;
  try {
    Start other_start = beside(first_, way_, largest_velocity_);
    if (const auto& space = integrator.scene().space) other_start.q = space->normalised(other_start.q);
    integrator.reset(other_start);
  } catch (const Misuse&) {  // a start that nothing may be moved at
    followed = false;
  }
  for (long k = 0; k < steps_ && followed; ++k) followed = integrator.step().ok();
  followed = followed && integrator.sample(Momentum::projected, other).ok();
  integrator.restore(state);
  if (!followed) return;
  const double apart =
      std::max(max_norm(other.q - end.q) / way_, max_norm(other.p - end.p) / largest_momentum_);
  const double growth = apart / distance_beside;
  const double round_off = std::numeric_limits<double>::epsilon() * std::sqrt(static_cast<double>(steps_));
  const double uncertain = growth * std::max(round_off, std::isfinite(local) ? local : 0.0);
  if (!(growth > growth_of_no_power) || !(uncertain > too_uncertain)) return;
  std::ostringstream text;
  text.precision(2);
  text << "the motion amplifies errors by a factor of " << growth << (apart > 0.1 ? " or more" : "")
       << " until t = " << end.time << ", found by a second run beside this one: "
       << (growth * round_off > too_uncertain ? "round-off alone" : "the error of a step")
       << " becomes as large as " << std::min(100.0, 100.0 * uncertain)
       << " % of the motion, or more; a shorter run can be trusted";
  text_ = text.str();
}

}  // namespace diracstep
