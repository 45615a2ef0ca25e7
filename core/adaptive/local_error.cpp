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
constexpr int most_parts_to_kinks = 8, most_ends = 4;
constexpr double at_end = 0.01;               // of a step: both end at the same kink
constexpr double least_half = 32.0;           // in units of round-off of the time
constexpr double shortest_over_kinks = 1e-6;  // of the motion: so short steps do not cross kinks in a row
constexpr double of_the_rate = 1e-6;          // of T ẏ, which counts as a size
// Errors that are round-off, and what is allowed beside them.
constexpr double hardly_less = 0.5, erratic = 0.2, above_errors = 100.0;
constexpr double of_the_largest = 1e-10, above_round_off = 4e-16;

/// Whether nothing is left to step of a step.
bool is_round_off_of_time(double left, double size, double start) {
  return std::abs(left) <=
         std::max(1e-14 * std::abs(size), 4.0 * std::numeric_limits<double>::epsilon() * std::abs(start));
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
  least_ = Vector::Zero(seen_.q.size() + seen_.p.size());
  rest_.emplace(at.scene());
  refused_ = 0;
  stuck_ = 0;
  sliding_ = 0;
}

/// The halves by one integrator, the whole step by the other; false where one fails.  Both end their steps at
/// the first kink that they cross, so that each part of the motion is judged by its own error: `size` becomes
/// that of the whole, and where the halves come to a kink clearly before its end, the part to there is taken
/// instead.
bool LocalErrorControl::take_both(Integrator& fine, Integrator& whole, double& size, StepReport& report) {
  const double start = fine.time();
  for (int tried = 0; tried < most_parts_to_kinks; ++tried) {
    whole.restart(start, q_, p_, v_);
    report = whole.step(size);
    if (!report.ok()) return false;
    crossed_ = !whole.kinks_passed().empty();
    size = whole.time() - start;
    const double round_off = least_half * std::numeric_limits<double>::epsilon() * std::abs(start);
    if (crossed_ && std::abs(size) <= round_off) {  // nothing to divide
      fine.restart(whole.time(), whole.position(), whole.momentum(), whole.velocity_estimate());
      return true;
    }
    report = fine.step(0.5 * size);
    double left = whole.time() - fine.time();
    for (int k = 0; k < most_ends && report.ok() && !is_round_off_of_time(left, size, start); ++k) {
      const bool passed = !fine.kinks_passed().empty();
      crossed_ = crossed_ || passed;
      if (passed && std::abs(left) > at_end * std::abs(size)) break;
      report = fine.step(left);
      left = whole.time() - fine.time();
    }
    if (!report.ok()) return false;
    crossed_ = crossed_ || !fine.kinks_passed().empty();
    const std::string& stuck = fine.stuck_at_kink();
    stuck_ = stuck.empty() ? 0 : stuck_ + 1;
    if (stuck_ > most_stuck) {
      report.solve.status = SolveStatus::refused;
      report.failure = stuck;
      return false;
    }
    if (is_round_off_of_time(left, size, start)) return true;
    size = fine.time() - start;
    fine.restart(start, q_, p_, v_);
  }
  report.solve.status = SolveStatus::no_convergence;
  report.failure = "a step from t = " + to_text(start) + " and its halves cross other kinks, at any size";
  return false;
}

Vector LocalErrorControl::differences(const Integrator& fine, const Integrator& whole) const {
  Vector all(q_.size() + p_.size());
  all << fine.position() - whole.position(), fine.momentum() - whole.momentum();
  return all;
}

LocalErrorControl::Worst LocalErrorControl::error(const Integrator& fine, const Integrator& whole,
                                                  double size, bool by_forces) {
  const Vector difference = differences(fine, whole);
  Worst worst;
  const auto add = [&](const Vector& start, const Vector& end, const Vector& seen, Eigen::Index first,
                       double by_rest) {
    const double rate = of_the_rate * span_ / std::abs(size);
    sizes_ = seen.cwiseMax(end.cwiseAbs()).cwiseMax(rate * (end - start).cwiseAbs());
    const double least =
        std::max(of_the_largest, above_round_off / eps_) * std::max(max_norm(sizes_), by_rest);
    for (Eigen::Index i = 0; i < start.size(); ++i) {
      const double e = difference[first + i];
      const double allowed = eps_ * std::max({sizes_[i], least, least_[first + i]});
      if (!std::isfinite(e)) worst.part = HUGE_VAL;
      if (e != 0.0 && std::abs(e) / allowed > worst.part) worst = {std::abs(e) / allowed, e, first + i};
    }
  };
  add(q_, fine.position(), seen_.q, 0, by_forces ? std::abs(size) * rest_->speed(size) : 0.0);
  add(p_, fine.momentum(), seen_.p, q_.size(), by_forces ? rest_->momentum(size) : 0.0);
  return worst;
}

/// Forces are asked for where the step would be refused without them.
LocalErrorControl::Worst LocalErrorControl::error(const Integrator& fine, const Integrator& whole,
                                                  double size) {
  const Worst worst = error(fine, whole, size, false);
  if (worst.part <= 1.0 || !std::isfinite(worst.part) || fine.scene().space) return worst;
  Sample start;
  start.time = fine.time() - size;
  start.q = q_;
  start.p = p_;
  start.v = v_;
  rest_->see(start);
  return error(fine, whole, size, true);
}

/// Takes the step again with a size that hardly differs; what is allowed grows where differences are
/// round-off.  Where the step is divided at kinks they jump for another reason: the halves are divided at
/// other places.
bool LocalErrorControl::is_round_off(Integrator& fine, Integrator& whole, double start, double size,
                                     const Worst& worst) {
  if (whole.met_kinks()) return false;
  const Vector first = differences(fine, whole);
  StepReport report;
  double other_size = 0.999 * size;
  fine.restart(start, q_, p_, v_);
  if (!take_both(fine, whole, other_size, report) || whole.met_kinks()) return false;
  const Vector other = differences(fine, whole);
  const auto jumps = [&](Eigen::Index i) {
    return std::abs(other[i] - first[i]) > erratic * std::abs(first[i]);
  };
  if (!jumps(worst.component)) return false;
  for (Eigen::Index i = 0; i < first.size(); ++i)
    if (jumps(i))
      least_[i] = std::max(least_[i], above_errors * std::max(std::abs(other[i]), std::abs(first[i])) / eps_);
  return true;
}

StepReport LocalErrorControl::advance(Integrator& fine, Integrator& whole, double& size, double& next) {
  const double start = fine.time();
  q_ = fine.position();
  p_ = fine.momentum();
  v_ = fine.velocity_estimate();
  const double stages = 0.5 * (order_ + 1);
  StepReport report;
  double refused_size = 0.0, refused_part = HUGE_VAL;
  std::string stuck;
  for (bool first = true;; first = false) {
    const bool taken = take_both(fine, whole, size, report);
    for (const Integrator* integrator : {&whole, &fine})
      if (!integrator->stuck_at_kink().empty()) stuck = integrator->stuck_at_kink();
    const Worst worst = taken ? error(fine, whole, size) : Worst{HUGE_VAL};
    const double part = worst.part;
    if (taken && (part <= 1.0 || std::abs(size) <= smallest_)) {
      const double growth = part > 0.0 ? below_eps * std::pow(part, -1.0 / (order_ + 1)) : most_growth;
      next = crossed_ ? std::copysign(first_size(), size)
                      : size * std::clamp(growth, most_shrinking, first ? most_growth : 1.0);
      if (std::abs(size) >= shortest_over_kinks * span_)
        sliding_ = 0;
      else if (crossed_)
        ++sliding_;
      if (sliding_ > most_stuck) {
        report.solve.status = SolveStatus::refused;
        report.failure = "from t = " + to_text(start, 6) +
                         " the motion crosses a kink of the force in each of " + std::to_string(sliding_) +
                         " tiny steps: the force points back there from both sides; write one that is "
                         "steep instead of a jump, as tanh(v/eps)";
      }
      seen_.q = seen_.q.cwiseMax(fine.position().cwiseAbs());
      seen_.p = seen_.p.cwiseMax(fine.momentum().cwiseAbs());
      return report;
    }
    ++refused_;
    const bool shorter = std::abs(size) <= 0.5 * std::abs(refused_size);
    const bool stays = shorter && taken && std::isfinite(part) &&
                       part * std::abs(refused_size) > hardly_less * refused_part * std::abs(size);
    const bool round_off = stays && is_round_off(fine, whole, start, size, worst);
    if (refused_size == 0.0 || shorter) {
      refused_size = size;
      refused_part = part;
    }
    if (fine.time() != start) fine.restart(start, q_, p_, v_);
    if (stuck_ > most_stuck) return report;
    if (round_off) continue;
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
