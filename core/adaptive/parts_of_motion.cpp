#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/adaptive/pointwise_motion.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <utility>

/// How the reversible steps of an AdaptiveIntegrator begin behind a kink, where the forces may be far faster
/// or slower than before it.
namespace diracstep {

namespace {

constexpr double just_behind = 1e-6;  // of the step before: so near a kink ω is measured first
constexpr double first_of_two = 0.382;
constexpr int most_halvings = 30;
constexpr double largest_difference = 0.01, least_difference = 1e-12;  // of q and p
constexpr double part_of_largest = 1e-10;
constexpr double same_time = 1e-3;  // of a step: both end at the same kink

struct Point {
  double time;
  Vector q, p, v;
  Vector carried;  ///< p or, under rows, whose impulses p may hold, the velocity
};

Point point_of(const Integrator& at, PointwiseMotion& motion) {
  Point point{at.time(), at.position(), at.momentum(), at.velocity_estimate(), at.momentum()};
  Vector v = point.v;
  if (at.scene().rows() > 0 && motion.velocity(point.time, point.q, point.p, v).ok())
    point.carried = std::move(v);
  return point;
}

/// Largest difference of a component, in parts of its size or, of a position, of its way.
double difference(const Point& start, const Point& whole, const Point& parts) {
  const double h = std::abs(whole.time - start.time);
  double worst = 0.0;
  const auto add = [&](const Vector& at_whole, const Vector& at_parts, const Vector& sizes) {
    const double least = part_of_largest * max_norm(sizes);
    for (Eigen::Index i = 0; i < at_whole.size(); ++i) {
      const double off = std::abs(at_whole[i] - at_parts[i]);
      if (off != 0.0) worst = std::max(worst, off / std::max(sizes[i], least));
    }
  };
  Vector ways = whole.q.cwiseAbs().cwiseMax(start.q.cwiseAbs());
  if (start.v.size() == ways.size()) ways = ways.cwiseMax(h * start.v.cwiseAbs());
  add(whole.q, parts.q, ways);
  add(whole.carried, parts.carried, whole.carried.cwiseAbs().cwiseMax(start.carried.cwiseAbs()));
  return worst;
}

}  // namespace

/// Whether a step of the side integrator ends where two parts of it do, to eps^(p + 1) of q and p (v under
/// rows) for order p; it is left where it was.
bool AdaptiveIntegrator::agree(double size, double eps) {
  const Point start = point_of(side_, meter_->motion());
  const auto back = [&] { side_.restart(start.time, start.q, start.p, start.v); };
  if (!side_.step(size).ok()) {
    back();
    return false;
  }
  const Point whole = point_of(side_, meter_->motion());
  const double taken = whole.time - start.time;  // to a kink
  back();
  if (taken == 0.0) return false;  // it stands at a kink that it cannot leave
  bool ok = side_.step(first_of_two * taken).ok() && side_.kinks_passed().empty();
  if (const double left = whole.time - side_.time(); ok && left * taken > 0.0) ok = side_.step(left).ok();
  const Point parts = point_of(side_, meter_->motion());
  back();
  const double allowed = std::clamp(std::pow(eps, options_.order + 1), least_difference, largest_difference);
  return ok && std::abs(parts.time - whole.time) <= same_time * std::abs(taken) &&
         difference(start, whole, parts) <= allowed;
}

/// The size of a first step of the side integrator: the one given, or as often halved as agree() asks for.
/// Where no size agrees, as at dry friction, the one given.
double AdaptiveIntegrator::resolved_size(double size, double eps) {
  double shorter = size;
  for (int k = 0; k <= most_halvings; ++k, shorter *= 0.5)
    if (agree(shorter, eps)) return shorter;
  return size;
}

/// Of a part that begins where `at` stands, behind a kink with differences that are short at first: those of
/// the step before may reach all through what acts there, as through a contact, and see nothing of it.
AdaptiveIntegrator::PartOfMotion AdaptiveIntegrator::begin_part(const Integrator& at, double size_before,
                                                                bool behind_kink, Vector& v) {
  double size = size_before;
  PartOfMotion part{{}, size, adaptive_.eps};
  meter_->set_typical(meter_->scales().typical);
  const auto measure_at = [&] {
    part.rate = rate_of(at, size, behind_kink ? RateMeter::beside_kink * size : 0.0, false, v);
    return part.rate.ok();
  };
  if (behind_kink) {
    size *= just_behind;
    if (!measure_at()) return part;
    meter_->fit_typical(v, size);
  }
  if (!measure_at()) return part;
  part.size = std::copysign(part.eps / part.rate.rate, size_before);
  if (!behind_kink || adaptive_.control == StepControl::in_step) return part;
  if (&at != &side_) side_.restart(at.time(), at.position(), at.momentum(), v);
  size = resolved_size(part.size, part.eps);
  part.eps *= size / part.size;
  part.size = size;
  return part;
}

/// From where a side step ended at a kink on to t, by steps as long as the rate there allows.
StepReport AdaptiveIntegrator::side_steps_behind_kinks(double t) {
  const double typical = meter_->typical(), sign = t < side_.time() ? -1.0 : 1.0;
  const double least = 1e-12 * std::abs(t - side_.time());
  StepReport report;
  Vector v = side_.velocity_estimate();
  PartOfMotion part{{}, t - side_.time(), adaptive_.eps};
  bool behind_kink = true;
  while (report.ok() && sign * (t - side_.time()) > least) {
    const double left = t - side_.time();
    if (behind_kink)
      part = begin_part(side_, part.size, true, v);
    else
      part.rate = rate_of(side_, part.size, 0.0, false, v);
    if (!part.rate.ok()) {
      report = failed(part.rate.failure);
      break;
    }
    part.size = std::copysign(std::min(part.eps / part.rate.rate, std::abs(left)), left);
    report = side_.step(part.size);
    behind_kink = !side_.kinks_passed().empty();
  }
  meter_->set_typical(typical);
  return report;
}

}  // namespace diracstep
