#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/local_error.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <limits>
#include <numbers>

namespace diracstep {

namespace {

constexpr std::size_t most_instants = 200;
constexpr int most_stuck = 20;  // steps one after the other that cross a kink undivided
constexpr double below_eps = 0.9, most_growth = 10.0, most_shrinking = 0.1, after_failure = 0.25;
constexpr double of_the_rate = 1e-6;  // of T ẏ, which counts as a size
constexpr double of_the_largest = 1e-10, above_round_off = 4e-16;

/// |e_i| / s_i, the largest.
double largest_ratio(const Vector& fine, const Vector& whole, const Vector& sizes, double least) {
  double largest = 0.0;
  for (Eigen::Index i = 0; i < fine.size(); ++i) {
    const double difference = std::abs(fine[i] - whole[i]);
    if (difference > 0.0) largest = std::max(largest, difference / std::max(sizes[i], least));
    if (!std::isfinite(difference)) return HUGE_VAL;
  }
  return largest;
}

}  // namespace

std::vector<double> instants_on_the_way(const Scene& scene, double end) {
  std::vector<double> all;
  if (!scene.kinks) return all;
  const double start = scene.start.time;
  for (const Kinks::Instant& instant : scene.kinks->instants(std::min(start, end), std::max(start, end)))
    all.push_back(instant.time);
  if (all.size() > most_instants) all.clear();
  if (end < start) std::ranges::reverse(all);
  return all;
}

bool may_change_later(const Scene& scene, double end) {
  if (scene.kinks && scene.kinks->count() > 0) return true;
  if (!scene.stepped_function().structure().autonomous) return true;
  constexpr int times = 32;
  const Start& start = scene.start;
  const int n = scene.dimension();
  ConstraintsAtPoint rows(scene.constraints, n);
  const auto values = [&](double t) {
    Vector all = Vector::Zero(n + scene.rows());
    if (scene.force) scene.force->value(t, start.q, start.v, all.head(n));
    if (scene.rows() == 0) return all;
    rows.evaluate(t, start.q);
    all.tail(scene.rows()) = rows.offsets();
    return all;
  };
  const Vector first = values(start.time);
  for (int k = 1; k <= times; ++k) {
    const double part = std::fmod(k * std::numbers::phi, 1.0);  // no multiple of a period
    const Vector then = values(start.time + part * (end - start.time));
    if (!(then.array() == first.array()).all()) return true;
  }
  return false;
}

LocalErrorControl::LocalErrorControl(double eps, int order, double span, double smallest)
    : eps_(eps), span_(span), smallest_(smallest), order_(order) {}

void LocalErrorControl::start(const Integrator& at) {
  seen_ = {at.position().cwiseAbs(), at.momentum().cwiseAbs()};
  refused_ = 0;
  stuck_ = 0;
}

/// The halves by one integrator, the whole step by the other; false where one fails.
bool LocalErrorControl::take_both(Integrator& fine, Integrator& whole, double size, StepReport& report) {
  const double start = fine.time();
  whole.restart(start, q_, p_, v_);
  report = whole.step(size);
  if (!report.ok()) return false;
  report = fine.step(0.5 * size);
  if (report.ok()) report = fine.step(start + size - fine.time());
  const std::string& stuck = fine.stuck_at_kink();
  stuck_ = stuck.empty() ? 0 : stuck_ + 1;
  if (stuck_ > most_stuck) {
    report.solve.status = SolveStatus::refused;
    report.failure = stuck;
  }
  return report.ok();
}

/// In parts of eps.
double LocalErrorControl::error(const Integrator& fine, const Integrator& whole, double size) {
  double largest = 0.0;
  const auto add = [&](const Vector& start, const Vector& end, const Vector& other, const Vector& seen) {
    const double rate = of_the_rate * span_ / std::abs(size);
    sizes_ = seen.cwiseMax(end.cwiseAbs()).cwiseMax(rate * (end - start).cwiseAbs());
    const double least = std::max(of_the_largest, above_round_off / eps_) * max_norm(sizes_);
    largest = std::max(largest, largest_ratio(end, other, sizes_, least) / eps_);
  };
  add(q_, fine.position(), whole.position(), seen_.q);
  add(p_, fine.momentum(), whole.momentum(), seen_.p);
  return largest;
}

StepReport LocalErrorControl::advance(Integrator& fine, Integrator& whole, double& size, double& next) {
  const double start = fine.time();
  q_ = fine.position();
  p_ = fine.momentum();
  v_ = fine.velocity_estimate();
  const double stages = 0.5 * (order_ + 1);
  StepReport report;
  std::string stuck;
  for (bool first = true;; first = false) {
    const bool taken = take_both(fine, whole, size, report);
    for (const Integrator* integrator : {&whole, &fine})
      if (!integrator->stuck_at_kink().empty()) stuck = integrator->stuck_at_kink();
    const double part = taken ? error(fine, whole, size) : HUGE_VAL;
    if (taken && (part <= 1.0 || std::abs(size) <= smallest_)) {
      const double growth = part > 0.0 ? below_eps * std::pow(part, -1.0 / (order_ + 1)) : most_growth;
      next = size * std::clamp(growth, most_shrinking, first ? most_growth : 1.0);
      seen_.q = seen_.q.cwiseMax(fine.position().cwiseAbs());
      seen_.p = seen_.p.cwiseMax(fine.momentum().cwiseAbs());
      return report;
    }
    ++refused_;
    if (fine.time() != start) fine.restart(start, q_, p_, v_);
    if (stuck_ > most_stuck) return report;
    const double shrinking = taken ? below_eps * std::pow(part, -1.0 / (stages + 1.0)) : after_failure;
    size *= std::clamp(shrinking, most_shrinking, 0.9);
    if (std::abs(size) > 16.0 * std::numeric_limits<double>::epsilon() * std::abs(start) &&
        std::abs(size) > 1e-15 * span_)
      continue;
    if (taken) {
      report.solve.status = SolveStatus::no_convergence;
      report.failure = "no size of a step from t = " + to_text(start) +
                       " has a local error as small as asked for; is the motion smooth there?";
    }
    if (!stuck.empty()) report.failure = stuck;
    return report;
  }
}

}  // namespace diracstep
