#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/rest_sizes.hpp>
#include <diracstep/core/runs/work_check.hpp>
#include <span>
#include <sstream>
#include <utility>

namespace diracstep {

namespace {

constexpr double too_much_taken = 1e-3, too_far_off = 0.01, too_far_off_at_low_order = 0.1;
constexpr int order_that_keeps_energy = 3;
constexpr double quadrature_errors = 5.0;

bool changes_by_force_alone(const Scene& scene) {
  return scene.force && !scene.space && !scene.by_hamiltonian() && scene.lagrangian->structure().autonomous &&
         std::ranges::all_of(scene.constraints, [](const auto& rows) { return rows->workless(); });
}

/// Of an energy: that of the start, and what forces, which balance in a scene at rest, do in the time so far.
double round_off(const Scene& scene, double start_energy, const Sample& point) {
  RestSizes rest(scene);
  rest.see(point);
  return at_rest * std::max(std::abs(start_energy), rest.energy(point.time - scene.start.time));
}

}  // namespace

WorkCheck::WorkCheck(const Integrator& integrator)
    : scene_(integrator.scene()),
      order_(integrator.method().order),
      damped_(integrator.method().damped),
      watched_(changes_by_force_alone(scene_)),
      to_{integrator.time(), integrator.position(), integrator.velocity_estimate()},
      force_(Vector::Zero(scene_.dimension())) {
  if (watched_) power_ = power(to_.time, to_.q, to_.v);
}

double WorkCheck::power(double t, const Vector& q, const Vector& v) {
  scene_.force->value(t, q, v, force_);
  return force_.dot(v);
}

/// By three Gauss points, and by Simpson's rule, along a cubic; leaves the power at its end.
WorkCheck::Integral WorkCheck::work_between(const PathPoint& from, const PathPoint& to) {
  const PathCubic path{from, to};
  const double h = to.time - from.time;
  double by_gauss = 0.0, middle = 0.0;
  for (const auto& [place, weight] : gauss_points) {
    path.at(from.time + place * h, q_, v_);
    const double here = power(from.time + place * h, q_, v_);
    by_gauss += weight * here;
    if (place == 0.5) middle = here;
  }
  const double begin = std::exchange(power_, power(to.time, to.q, to.v));
  const double by_simpson = (begin + 4.0 * middle + power_) / 6.0;
  return {h * by_gauss, std::abs(h * (by_gauss - by_simpson))};
}

void WorkCheck::look(const Integrator& integrator) {
  std::swap(from_, to_);
  to_.time = integrator.time();
  to_.q = integrator.position();
  to_.v = integrator.velocity_estimate();
  const auto add = [this](const Integral& part) {
    work_.value += part.value;
    work_.error += part.error;
    turned_over_ += std::abs(part.value);
  };
  const std::span<const KinkPassed> kinks = integrator.kinks_passed();
  if (integrator.met_kinks() && kinks.empty()) {  // divided at instants, as of a pulse, that no cubic knows
    begun_ = false;
    power_ = power(to_.time, to_.q, to_.v);
    return;
  }
  // In parts from kink to kink, between which the force is smooth.
  PathPoint begin = from_;
  for (const KinkPassed& kink : kinks) {
    if (kink.time == begin.time || kink.time == to_.time) continue;
    PathPoint end{kink.time, kink.at.q, kink.at.v};
    add(work_between(begin, end));
    begin = std::move(end);
  }
  add(work_between(begin, to_));
}

void WorkCheck::see(const Sample& point) {
  if (!watched_) return;
  Integral rest{0.0, 0.0};
  if (point.time != to_.time) {
    const double at_node = power_;
    rest = work_between(to_, {point.time, point.q, point.v});
    power_ = at_node;
  }
  if (!begun_) {  // the work from here on; points may be seen every few steps alone
    begun_ = true;
    start_energy_ = point.energy;
    work_ = {-rest.value, rest.error};
    turned_over_ = 0.0;
    return;
  }
  const Integral work{work_.value + rest.value, work_.error + rest.error};
  const double change = point.energy - start_energy_;
  at_play_ = std::max({at_play_, 0.5 * std::abs(point.p.dot(point.v)), std::abs(change)});
  const double lost = work.value - change;
  const double off = (damped_ ? lost : std::abs(lost)) - quadrature_errors * work.error;
  if (!(off > off_)) return;
  const double before = std::exchange(off_, off);
  if (doubted() && off <= round_off(scene_, start_energy_, point)) {
    off_ = before;
    return;
  }
  off_by_ = point.time;
  change_ = change;
  done_ = work.value;
}

bool WorkCheck::doubted() const {
  if (damped_) return off_ > too_much_taken * at_play_;
  const double part = order_ < order_that_keeps_energy ? too_far_off_at_low_order : too_far_off;
  return off_ > part * std::max(at_play_, turned_over_);
}

std::string WorkCheck::text() const {
  if (!doubted()) return {};
  std::ostringstream text;
  if (!damped_) {
    text << "the energy changed by " << change_ << " until t = " << off_by_ << ", and the forces did work of "
         << done_ << ": the step is too large for the result to be trusted";
    return text.str();
  }
  text.precision(2);
  text << "the method took " << 100.0 * off_ / at_play_ << " % of the energy at play until t = " << off_by_
       << ", beside the work of the forces: it damps what its steps do not resolve; a smaller --eps or step, "
          "or a method that keeps the energy if that matters here";
  return text.str();
}

}  // namespace diracstep
