#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/adaptive_integrator.hpp>
#include <diracstep/core/adaptive/pointwise_motion.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/spaces/space.hpp>

/// The reversible steps of an AdaptiveIntegrator, and the irreversible ones for comparison: their sizes by
/// the monitor.
namespace diracstep {

namespace {

constexpr double lowest_ratio = 0.8, highest_ratio = 1.25;  // of z to ω before the guard acts
constexpr double size_tolerance = 1e-10;    // relative, of an equation in the step: below it is round-off
constexpr double just_behind_start = 1e-6;  // of a step
constexpr int max_sizes = 30;               // tried for one step

}  // namespace

/// v, ω and, if asked for, d(ln ω)/dt at the current node of an integrator, or so long ahead of it.  ω is
/// bounded from above, by a number that is even in v as ω is.
Rate AdaptiveIntegrator::rate_of(const Integrator& at, double size, double ahead, bool growth, Vector& v) {
  const SolveReport report = meter_->motion().velocity(at.time(), at.position(), at.momentum(), v);
  if (!report.ok()) return {0.0, 0.0, std::string("no velocity for the monitor: ") + describe(report.status)};
  const auto rate_at = [&](const Vector& q) {
    return growth ? meter_->rate_and_growth(at.time() + ahead, q, v, size)
                  : meter_->rate(at.time() + ahead, q, v, size);
  };
  Rate rate = ahead == 0.0 ? rate_at(at.position())
                           : rate_at(moved(meter_->motion().space(), at.position(), ahead * v));
  if (const double largest = largest_rate(); rate.ok() && rate.rate > largest) rate = {largest, 0.0, {}};
  return rate;
}

/// Whether the motion has just crossed a kink or, where it begins at one, does within a time so far ahead.
bool AdaptiveIntegrator::at_kink(double ahead) {
  if (!main_.kinks_passed().empty()) return true;
  const Scene& scene = main_.scene();
  if (!scene.kinks || scene.space ||
      !meter_->motion().velocity(time(), main_.position(), main_.momentum(), v_).ok())
    return false;
  Vector here(scene.kinks->count()), there(here);
  scene.kinks->evaluate(time(), main_.position(), v_, here);
  scene.kinks->evaluate(time() + ahead, main_.position() + ahead * v_, v_, there);
  for (Eigen::Index k = 0; k < here.size(); ++k)
    if (scene.kinks->kinds()[static_cast<std::size_t>(k)] == Kinks::Kind::kink && here[k] * there[k] <= 0.0)
      return true;
  return false;
}

bool AdaptiveIntegrator::measure(bool growth, bool behind_kink) {
  // At a kink just crossed it is measured where no difference reaches across.
  const double ahead = behind_kink ? RateMeter::beside_kink * next_size_ : 0.0;
  rate_ = rate_of(main_, next_size_, ahead, growth, v_);
  if (!rate_.ok()) return false;
  report_.slowest = std::min(report_.slowest, rate_.rate);
  report_.fastest = std::max(report_.fastest, rate_.rate);
  return true;
}

bool AdaptiveIntegrator::start_control() {
  const bool growth = adaptive_.control == StepControl::integrating;
  // The width of the differences follows the step, which is not known yet: measure twice.
  const bool behind_kink = at_kink(just_behind_start * next_size_);
  const PartOfMotion part = begin_part(main_, next_size_, behind_kink, v_);
  rate_ = part.rate;
  if (!rate_.ok()) return false;
  next_size_ = part.size;
  eps_ = part.eps;
  if (!measure(growth, behind_kink)) return false;
  z_ = rate_.rate + 0.5 * sign_ * eps_ * rate_.growth;
  next_size_ = sign_ * eps_ / (growth && z_ > 0.0 ? z_ : rate_.rate);
  last_sizes_.clear();
  for (const double fraction : fractions_)
    last_sizes_.push_back({fraction * next_size_, fraction * next_size_});
  return true;
}

StepReport AdaptiveIntegrator::control_step(double size) {
  const double begun = time();
  StepReport report = main_.step(size);
  if (!report.ok()) return report;
  if (!main_.kinks_passed().empty()) {  // behind it the motion has another rate
    note(time() - begun);
    return start_control() ? report : failed(rate_.failure);
  }
  note(size);
  const bool integrating = adaptive_.control == StepControl::integrating;
  if (!measure(integrating, false)) return failed(rate_.failure);
  if (!integrating) {
    next_size_ = sign_ * eps_ / rate_.rate;
    return report;
  }
  const double change = sign_ * eps_ * rate_.growth;
  const double ratio = (z_ + 0.5 * change) / rate_.rate;
  report_.lowest_ratio = std::min(report_.lowest_ratio, ratio);
  report_.highest_ratio = std::max(report_.highest_ratio, ratio);
  z_ += change;
  if (!(ratio >= lowest_ratio && ratio <= highest_ratio) || !(z_ > 0.25 * rate_.rate)) {
    z_ = std::max(rate_.rate + 0.5 * change, 0.5 * rate_.rate);
    ++report_.resets;
  }
  next_size_ = sign_ * eps_ / z_;
  return report;
}

StepReport AdaptiveIntegrator::with_finer_steps(double part, const Sample& from, Sample& end) {
  constexpr long most_more = 10;  // times the steps taken
  const double until = time(), eps = adaptive_.eps, eps_here = eps_, z = z_, next = next_size_,
               typical = meter_->typical();
  const long most = (most_more + 1) * std::max(1L, work().steps);
  const Snapshot state = main_.save();
  const ControlReport control = report_;
  const Rate rate = rate_;
  const Vector v = v_;
  const std::vector<Sizes> sizes = last_sizes_;
  adaptive_.eps *= part;
  v_ = from.v;
  main_.restart(from.time, from.q, from.p, from.v);
  StepReport report;
  if (!start_control()) report = failed(rate_.failure);
  while (report.ok() && std::abs(until - time()) > std::abs(next_size_))
    report = work().steps < most ? step() : failed("more steps than expected");
  if (report.ok()) report = sample_at(until, Momentum::projected, end);
  main_.restore(state);
  adaptive_.eps = eps;
  eps_ = eps_here;
  z_ = z;
  next_size_ = next;
  meter_->set_typical(typical);
  report_ = control;
  rate_ = rate;
  v_ = v;
  last_sizes_ = sizes;
  return report;
}

/// Solves F(h) = h (ω(y_0) + ω(y_1(h)))/2 − eps = 0, by secants after a first correction with the slope
/// ω(y_1).
StepReport AdaptiveIntegrator::solve_size(double eps, double guess, double& size) {
  const double rate0 = rate_.rate;
  double h = guess, last_h = 0.0, last_f = 0.0;
  StepReport report;
  for (int tried = 0; tried < max_sizes; ++tried) {
    report = tried == 0 ? main_.step(h) : main_.retry(h);
    if (!report.ok()) return report;
    if (!measure(false, !main_.kinks_passed().empty())) return failed(rate_.failure);
    const double f = 0.5 * h * (rate0 + rate_.rate) - eps;
    size = h;
    if (std::abs(f) <= size_tolerance * std::abs(eps)) return report;
    const bool first = tried == 0 || h == last_h;
    const double slope = first ? rate_.rate : (f - last_f) / (h - last_h);
    const double change = slope > 0.0 ? -f / slope : 0.5 * (eps / rate0 - h);
    last_h = h;
    last_f = f;
    h *= 1.0 + std::clamp(change / h, -0.5, 1.0);
  }
  return failed("no size of the step satisfies the equation for it; take a smaller eps");
}

}  // namespace diracstep
