#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/adaptive/pointwise_motion.hpp>
#include <diracstep/core/adaptive/ramp_rates.hpp>
#include <diracstep/core/adaptive/rate_monitor.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <sstream>
#include <utility>
#include <vector>

namespace diracstep {

namespace {

/// Half the width of a difference, in steps.
constexpr double difference_width = 1e-3;
/// Radians of the control that stand for a turn by all that a retraction is injective on: steps of the usual
/// 0.2 turn by half of that at most, also where nothing else changes.
constexpr double turned = 0.4;

Vector probing_velocity(const Vector& v) {
  const double size = v.size() > 0 && v.lpNorm<Eigen::Infinity>() > 0.0 ? v.lpNorm<Eigen::Infinity>() : 1.0;
  Vector probe = v;
  for (Eigen::Index i = 0; i < v.size(); ++i)
    probe[i] += size * (i % 2 == 0 ? 0.7 : -0.4) * (1.0 + 0.1 * static_cast<double>(i));
  return probe;
}

}  // namespace

bool has_accelerations(const Scene& scene) {
  return scene.lagrangian && !scene.lagrangian->structure().y_hessian_zero &&
         !first_order_motions(scene).exist();
}

std::string why_no_accelerations(const Scene& scene) {
  if (!scene.lagrangian) return "the Hamiltonian is degenerate";
  if (scene.lagrangian->structure().y_hessian_zero) return "the Lagrangian is linear in v";
  return first_order_motions(scene).hide_equations()
             ? "the kernel of ∂²L/∂v² moves or hides equations"
             : "the Lagrangian has velocities without mass, along a kernel of ∂²L/∂v²";
}

void require_even(const Monitor& monitor, const Start& start) {
  if (!monitor.rate) return;
  const double at_start = monitor.rate(start.time, start.q, start.v);
  std::ostringstream message;
  message.precision(12);
  if (!(at_start > 0.0) || !std::isfinite(at_start)) {
    message << "the monitor is " << at_start << " at the start; it must be positive and finite";
    throw Misuse(message.str());
  }
  for (const Vector& v : {start.v, probing_velocity(start.v)}) {
    const double there = monitor.rate(start.time, start.q, v), back = monitor.rate(start.time, start.q, -v);
    if (!std::isfinite(there) || std::abs(there - back) <= 1e-12 * std::abs(there)) continue;
    message << "the monitor is not even in the velocity: it is " << there << " at v and " << back
            << " at -v, for v = (" << v.transpose() << "); steps chosen by it are not reversible";
    throw Misuse(message.str());
  }
}

RateMeter::RateMeter(const Scene& scene, const SolverFactory& solvers, Monitor monitor, MonitorScales scales,
                     double end)
    : monitor_(std::move(monitor)),
      scales_(scales),
      typical_(scales.typical),
      a_(Columns::Zero(scene.dimension(), 5)),
      ramps_(std::make_unique<RampRates>(scene, scene.start.time, end)),
      g_(Columns::Zero(ramps_->count(), 5)) {
  q_.setZero(scene.storage_size());
  v_.setZero(scene.dimension());
  origin_ = v_;
  if (scene.space) turn_.setZero(scene.space->group_dimension());
  motion_ = std::make_unique<PointwiseMotion>(scene, solvers);
}

RateMeter::RateMeter(RateMeter&&) noexcept = default;
RateMeter::~RateMeter() = default;

/// On a configuration space of its own the Taylor polynomial x begins at zero, and the point is q τ(x).
const double* RateMeter::base(ConstVectorRef q) const {
  return motion_->space() != nullptr ? origin_.data() : q.data();
}

void RateMeter::place_on_space(ConstVectorRef q) {
  if (motion_->space() != nullptr) q_ = motion_->space()->moved(q, q_);
}

bool RateMeter::accelerations(double t, ConstVectorRef q, ConstVectorRef v, double delta, int reach) {
  last_ = motion_->acceleration(t, q, v, a_.col(2));
  read_ramps(2, t, q, v);
  for (const int place : {1, 3, 0, 4}) {
    if (std::abs(place - 2) > reach || !last_.ok()) continue;
    const double tau = (place - 2) * delta;
    const Eigen::Map<const Vector> from(base(q), v.size());
    q_ = from + tau * v + (0.5 * tau * tau) * a_.col(2);
    v_ = v + tau * a_.col(2);
    if (place == 0 || place == 4) {  // ȧ of the inner three: without it d(ln ω)/dt lacks what a owes to v
      const double factor = tau * tau / (4.0 * delta);
      v_ += factor * (a_.col(3) - a_.col(1));
      q_ += (factor * tau / 3.0) * (a_.col(3) - a_.col(1));
    }
    place_on_space(q);
    last_ = motion_->acceleration(t + tau, q_, v_, a_.col(place));
    read_ramps(place, t + tau, q_, v_);
  }
  return last_.ok();
}

void RateMeter::read_ramps(int place, double t, ConstVectorRef q, ConstVectorRef v) {
  if (ramps_->count() > 0) ramps_->evaluate(t, q, v, g_.col(place));
}

double RateMeter::generic_rate(int place, double t, ConstVectorRef v, double delta) {
  const double tau = (place - 2) * delta, typical = typical_ * typical_;
  const double v2 = (v + tau * a_.col(2)).squaredNorm(), a2 = a_.col(place).squaredNorm();
  const double jerk2 = (a_.col(place + 1) - a_.col(place - 1)).squaredNorm() / (4.0 * delta * delta);
  double floor = scales_.lowest * scales_.lowest;
  if (const Space* space = motion_->space()) {
    v_ = v + tau * a_.col(2);
    space->embed(v_, turn_);
    const double turning = turned * space->part_of_chart(turn_);
    floor += turning * turning;
  }
  const double below = typical * v2 + a2;
  if (!ramps_->none())
    floor += ramps_->squared(t + tau, g_.col(place - 1), g_.col(place), g_.col(place + 1), delta);
  return std::sqrt((below > 0.0 ? (typical * a2 + jerk2) / below : 0.0) + floor);
}

/// ω0 is to be no less than the rate that the point alone tells, sqrt(|ȧ|/|v|), at most |ȧ|/|a|: behind the
/// kink of a spring that begins to act that is the spring's, with which ω stays it all through the contact.
void RateMeter::fit_typical(ConstVectorRef v, double step) {
  if (!generic()) return;
  const double jerk = (a_.col(3) - a_.col(1)).norm() / (2.0 * difference_width * std::abs(step)),
               by_v = std::sqrt(jerk / v.norm()), by_a = jerk / a_.col(2).norm();
  if (const double alone = std::min(by_v, by_a); std::isfinite(alone)) typical_ = std::max(typical_, alone);
}

double RateMeter::own_rate(double t, ConstVectorRef q, ConstVectorRef v, double delta, int place) {
  const double tau = (place - 2) * delta;
  q_ = Eigen::Map<const Vector>(base(q), v.size()) + tau * v;
  v_ = v;
  if (monitor_.depends_on_velocity) {
    q_ += (0.5 * tau * tau) * a_.col(2);
    v_ += tau * a_.col(2);
  }
  place_on_space(q);
  return monitor_.rate(t + tau, q_, v_);
}

Rate RateMeter::failed() const {
  return {0.0, 0.0, std::string("no acceleration for the monitor: ") + describe(last_.status)};
}

Rate RateMeter::rate(double t, ConstVectorRef q, ConstVectorRef v, double step) {
  const double delta = difference_width * std::abs(step);
  if (generic() && !accelerations(t, q, v, delta, 1)) return failed();
  Rate rate;
  rate.rate = generic() ? generic_rate(2, t, v, delta) : monitor_.rate(t, q, v);
  if (!(rate.rate > 0.0) || !std::isfinite(rate.rate))
    rate.failure = "the monitor is " + std::to_string(rate.rate) + "; it must be positive and finite";
  return rate;
}

Rate RateMeter::rate_and_growth(double t, ConstVectorRef q, ConstVectorRef v, double step) {
  const double delta = difference_width * std::abs(step);
  double before = 0.0, after = 0.0;
  Rate rate;
  if (generic()) {
    if (!accelerations(t, q, v, delta, 2)) return failed();
    before = generic_rate(1, t, v, delta);
    rate.rate = generic_rate(2, t, v, delta);
    after = generic_rate(3, t, v, delta);
  } else {
    if (monitor_.depends_on_velocity && !accelerations(t, q, v, delta, 0)) return failed();
    before = own_rate(t, q, v, delta, 1);
    rate.rate = monitor_.rate(t, q, v);
    after = own_rate(t, q, v, delta, 3);
  }
  rate.growth = std::log(after / before) / (2.0 * delta);
  if (!(rate.rate > 0.0) || !std::isfinite(rate.rate) || !std::isfinite(rate.growth)) {
    std::ostringstream message;
    message << "the monitor is " << rate.rate << " at t = " << t << ", around it " << before << " and "
            << after << "; it must be positive and finite";
    rate.failure = message.str();
  }
  return rate;
}

}  // namespace diracstep
