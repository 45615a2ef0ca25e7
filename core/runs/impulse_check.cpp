#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/time_kinks.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/gauss_rule.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/impulse_check.hpp>
#include <diracstep/core/runs/step_comparison.hpp>

namespace diracstep {

namespace {

constexpr long most_parts = 1000;
constexpr double followed = 1e-4;  // of the largest momentum
constexpr int halvings = 30;       // of the panels towards an end
constexpr int most_points = 8;

}  // namespace

struct ImpulseCheck::Instants {
  TimeKinks known;
  std::vector<Interval> parts = {};    ///< between switches
  std::vector<double> pulses = {};     ///< middles
  std::vector<double> in_a_part = {};  ///< of these
};

ImpulseCheck::ImpulseCheck(const Integrator& integrator)
    : scene_(integrator.scene()),
      order_(std::max(integrator.method().order, integrator.options().order)),
      watched_(scene_.kinks != nullptr && (scene_.lagrangian || scene_.by_hamiltonian())),
      instants_(std::make_shared<Instants>(
          Instants{TimeKinks(scene_.kinks, scene_.start.time, integrator.options().step)})),
      time_(integrator.time()),
      largest_(integrator.momentum().cwiseAbs()),
      missed_(Vector::Zero(largest_.size())),
      most_missed_(missed_),
      force_(missed_),
      other_(missed_) {
  if (!watched_) return;
  const GaussRule rule = gauss_rule(std::clamp((order_ + 1) / 2, 1, most_points));
  for (Eigen::Index i = 0; i < rule.places.size(); ++i)
    rule_.push_back({static_cast<double>(rule.places[i]), static_cast<double>(rule.weights[i])});
}

void ImpulseCheck::add(double weight, double t, Vector& sum) {
  scene_.force_and_momentum(t, q_, v_, p_, force_, other_);
  sum += weight * force_;
  if (!scene_.force) return;
  scene_.force->value(t, q_, v_, force_);
  sum += weight * force_;
}

void ImpulseCheck::look_at_part(double a, double b, const std::vector<double>& pulses) {
  fine_.setZero(missed_.size());
  coarse_.setZero(missed_.size());
  for (const GaussPoint& point : rule_) add(point.weight * (b - a), a + point.place * (b - a), coarse_);
  const auto add_panel = [&](double from, double to) {
    for (const GaussPoint& point : gauss_points)
      add(point.weight * (to - from), from + point.place * (to - from), fine_);
  };
  const auto add_segment = [&](double from, double to) {
    double size = 0.5 * (to - from);
    const double middle = from + size;
    for (int k = 0; k < halvings; ++k, size *= 0.5) {
      add_panel(from + 0.5 * size, k == 0 ? middle : from + size);
      add_panel(k == 0 ? middle : to - size, to - 0.5 * size);
    }
    add_panel(from, from + size);
    add_panel(to - size, to);
  };
  double from = a;
  for (const double t : pulses)
    if ((t - from) * (b - t) > 0.0) {
      add_segment(from, t);
      from = t;
    }
  add_segment(from, b);
  fine_ -= coarse_;
  if (!fine_.allFinite()) return;
  missed_ += fine_;
  most_missed_ = most_missed_.cwiseMax(missed_.cwiseAbs());
  if (const double here = max_norm(fine_); here > largest_part_) {
    largest_part_ = here;
    at_ = pulses.empty() ? a : pulses.front();
  }
}

void ImpulseCheck::look(double time, ConstVectorRef q, ConstVectorRef v, ConstVectorRef p) {
  const Interval step{time_, time - time_};
  time_ = time;
  largest_ = largest_.cwiseMax(p.cwiseAbs());
  if (looked_at_ >= most_parts || step.size == 0.0) return;
  auto& [known, parts, pulses, in_a_part] = *instants_;
  pulses.clear();
  known.add_pulses(step, pulses);
  if (!known.divide(step, parts) && pulses.empty() && !follows_) return;
  if (step.size < 0.0) std::ranges::reverse(pulses);
  q_ = q;
  v_ = v;
  p_ = p;
  const Vector before = missed_;
  for (const Interval& part : parts) {
    const double end = part.start + part.size;
    in_a_part.clear();
    for (const double t : pulses)
      if ((t - part.start) * (end - t) > 0.0) in_a_part.push_back(t);
    look_at_part(part.start, end, in_a_part);
    ++looked_at_;
  }
  follows_ = max_norm(missed_ - before) > followed * max_norm(largest_);
}

void ImpulseCheck::look_beside(const Sample& point) {
  const Vector missed = missed_;
  const double time = time_;
  const bool follows = follows_;
  look(point.time, point.q, point.v, point.p);
  missed_ = missed;
  time_ = time;
  follows_ = follows;
}

std::string ImpulseCheck::text() const {
  const double largest = max_norm(largest_);
  double missed = 0.0;
  for (Eigen::Index i = 0; i < largest_.size(); ++i)
    if (largest_[i] > 0.0) missed = std::max(missed, most_missed_[i] / largest);
  if (!(missed > StepComparison::largest_error(order_))) return {};
  return "the forces change fast near t = " + to_text(at_) +
         ", where the steps do not follow them: their impulse is off by " + to_text(100.0 * missed, 2) +
         " % of the largest momentum; take a smaller step there, or ask for an error, --error";
}

}  // namespace diracstep
