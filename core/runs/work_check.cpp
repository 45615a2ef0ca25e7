#include <algorithm>
#include <cmath>
#include <diracstep/core/runs/work_check.hpp>
#include <sstream>

namespace diracstep {

namespace {

constexpr double too_much_taken = 1e-3;
constexpr double quadrature_errors = 5.0;

}  // namespace

WorkCheck::WorkCheck(const Integrator& integrator)
    : scene_(integrator.scene()),
      watched_(integrator.method().damped && scene_.force && scene_.lagrangian->structure().autonomous &&
               std::ranges::all_of(scene_.constraints, [](const auto& rows) { return rows->workless(); })),
      to_{integrator.time(), integrator.position(), integrator.velocity_estimate()},
      force_(Vector::Zero(scene_.dimension())) {}

double WorkCheck::power(double t, const Vector& q, const Vector& v) {
  scene_.force->value(t, q, v, force_);
  return force_.dot(v);
}

/// By three Gauss points, and by Simpson's rule, along a cubic.
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
  const double by_simpson =
      (power(from.time, from.q, from.v) + 4.0 * middle + power(to.time, to.q, to.v)) / 6.0;
  return {h * by_gauss, std::abs(h * (by_gauss - by_simpson))};
}

void WorkCheck::look(const Integrator& integrator) {
  std::swap(from_, to_);
  to_.time = integrator.time();
  to_.q = integrator.position();
  to_.v = integrator.velocity_estimate();
  const Integral part = work_between(from_, to_);
  work_.value += part.value;
  work_.error += part.error;
}

void WorkCheck::see(const Sample& point) {
  if (!watched_) return;
  if (!begun_) {
    begun_ = true;
    start_energy_ = point.energy;
    return;
  }
  Integral work = work_;
  if (point.time != to_.time) {
    const Integral rest = work_between(to_, {point.time, point.q, point.v});
    work.value += rest.value;
    work.error += rest.error;
  }
  const double change = point.energy - start_energy_;
  at_play_ = std::max({at_play_, 0.5 * std::abs(point.p.dot(point.v)), std::abs(change)});
  const double taken = work.value - change - quadrature_errors * work.error;
  if (!(taken > taken_)) return;
  taken_ = taken;
  taken_by_ = point.time;
}

std::string WorkCheck::text() const {
  if (!(taken_ > too_much_taken * at_play_)) return {};
  std::ostringstream text;
  text.precision(2);
  text << "the method took " << 100.0 * taken_ / at_play_
       << " % of the energy at play until t = " << taken_by_
       << ", beside the work of the forces: it damps what its steps do not resolve; a smaller --eps or step, "
          "or a method that keeps the energy if that matters here";
  return text.str();
}

}  // namespace diracstep
