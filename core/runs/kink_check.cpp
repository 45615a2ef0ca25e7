#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/kink_check.hpp>
#include <limits>
#include <sstream>

namespace diracstep {

namespace {

constexpr double part_unknown = 0.25;  // of the impulse that a step cannot know, by which it ends off
constexpr double too_much = 0.005, too_much_at_instants = 0.0005;  // of the largest momentum
constexpr double too_much_of_undivided = 0.1;                      // for one step that no division leads over
constexpr double too_unresolved = 1e-3;                            // of q or p
constexpr double of_a_jump = 4.0;  // where the path is not that of the motion, its forces are beyond those
constexpr int looks_in_a_step = 2;
constexpr double finest_cut = 1e-12;      // in parts of a step
constexpr double at_the_beginning = 4.0;  // of these

}  // namespace

KinkCheck::KinkCheck(const Integrator& integrator, double end)
    : scene_(integrator.scene()), kinks_(scene_.kinks), crossings_(kinks_, integrator.time(), end) {
  if (crossings_.none() || scene_.space) kinks_ = nullptr;  // the path between points is one of R^n
  if (!kinks_) return;
  for (Vector* column : {&force_, &between_, &beside_, &beyond_, &change_, &momentum_, &own_})
    column->setZero(scene_.dimension());
  read(integrator, to_);
  force_at(to_.time, to_.q, to_.v, to_.p, force_);
  switches_.setZero(kinks_->count());
  kinks_->evaluate(to_.time, to_.q, to_.v, switches_);
  changes_.setConstant(kinks_->count(), HUGE_VAL);
}

/// Whether a switching function changes its sign in the last step, or may do so twice as far as its changes
/// in this and the step before tell, or an instant lies there: most steps are done with by this.
bool KinkCheck::may_cross() {
  switches_before_.swap(switches_);
  switches_.resize(kinks_->count());
  kinks_->evaluate(to_.time, to_.q, to_.v, switches_);
  bool may = crossings_.instant_between(from_.time, to_.time);
  for (Eigen::Index k = 0; k < switches_.size(); ++k) {
    const double before = switches_before_[k], now = switches_[k], change = std::abs(now - before);
    const double nearest = std::min(std::abs(before), std::abs(now));
    may = may || before * now <= 0.0 || !(nearest > 2.0 * std::max(change, changes_[k]));
    changes_[k] = change;
  }
  return may;
}

void KinkCheck::read(const Integrator& integrator, PathPoint& point) const {
  point.time = integrator.time();
  point.q = integrator.position();
  point.v = integrator.velocity_estimate();
  point.p = integrator.momentum();
}

void KinkCheck::force_at(double t, const Vector& q, const Vector& v, const Vector& p, Vector& force) {
  scene_.force_and_momentum(t, q, v, p, force, momentum_);
  if (!scene_.force) return;
  scene_.force->value(t, q, v, own_);
  force += own_;
}

KinkCheck::Missed KinkCheck::missed(const std::vector<KinkCrossing>& cuts, const PathCubic& path) {
  const double h = path.end() - path.begin();
  Missed sum;
  double begin = path.begin();
  for (std::size_t k = 0; k <= cuts.size(); ++k) {
    const double end = k < cuts.size() ? cuts[k].time : path.end();
    beside_.setZero(force_.size());
    beyond_.setZero(force_.size());
    for (const auto& [place, weight] : gauss_points) {
      const double t = begin + place * (end - begin), s = (t - path.begin()) / h;
      path.at(t, q_, v_);
      path.momentum_at(t, p_);
      force_at(t, q_, v_, p_, between_);
      beyond_ += weight *
                 (between_ -
                  between_.cwiseMax(force_before_.cwiseMin(force_)).cwiseMin(force_before_.cwiseMax(force_)))
                     .cwiseAbs();
      between_ -= (1.0 - s) * force_before_ + s * force_;
      beside_ += weight * between_.cwiseAbs();
    }
    const double length = std::abs(end - begin);
    sum.all += std::max(0.0, (beside_ - 2.0 * change_).maxCoeff()) * length;
    beyond_ -= of_a_jump * (force_ - force_before_).cwiseAbs() + 2.0 * change_;
    sum.pulses += std::max(0.0, beyond_.maxCoeff()) * length;
    begin = end;
  }
  return sum;
}

void KinkCheck::look(const Integrator& integrator) {
  std::swap(from_, to_);
  force_before_ = force_;
  read(integrator, to_);
  if (const double left = integrator.unresolved_between_kinks(); left > unresolved_) {
    unresolved_ = left;
    unresolved_time_ = from_.time;
  }
  force_at(to_.time, to_.q, to_.v, to_.p, force_);
  largest_momentum_ = std::max(largest_momentum_, max_norm(integrator.momentum()));
  const PathCubic path{from_, to_};
  const double h = path.end() - path.begin();
  if (!integrator.stuck_at_kink().empty() && scene_.rows() == 0) {  // rows have impulses of their own
    // Taken undivided over a contact it may have any impulse, and its ends know nothing of that.
    const double unknown = max_norm(to_.p - from_.p - 0.5 * h * (force_before_ + force_));
    if (unknown > too_much_of_undivided * largest_momentum_) {
      sum_.all += unknown;
      sum_.pulses += unknown;
      if (++jumps_ == 1) first_time_ = integrator.time();
    }
  }
  std::vector<KinkCrossing> cuts;
  if (may_cross()) {
    const double finest =
        std::max(finest_cut * std::abs(h), std::numeric_limits<double>::epsilon() * std::abs(path.end()));
    cuts = crossings_.along(path, path.begin(), path.end(), looks_in_a_step, finest);
    // A motion that begins at a kink leaves it and does not cross it.
    std::erase_if(cuts, [&](const KinkCrossing& cut) {
      return std::abs(cut.time - path.begin()) <= at_the_beginning * finest;
    });
  }
  if (cuts.empty()) {
    change_ = (force_ - force_before_).cwiseAbs();
    return;
  }
  if (integrator.met_kinks()) {  // the step was divided there
    change_.setZero();
    return;
  }
  const Missed impulse = missed(cuts, path);
  if (!(impulse.all > 0.0)) return;
  Missed& sum = std::ranges::any_of(cuts, &KinkCrossing::instant) ? sum_of_instants_ : sum_;
  sum.all += std::max(part_unknown * impulse.all, impulse.pulses);
  sum.pulses += impulse.pulses;
  if (++jumps_ > 1) return;
  first_ = cuts.front().number;
  first_time_ = integrator.time();
}

std::string KinkCheck::text(bool confirmed) const {
  if (unresolved_ > too_unresolved)
    return "the step from t = " + to_text(unresolved_time_) +
           " crosses two kinks of the force, and what lies between them, as a contact, is not resolved in "
           "it: "
           "take shorter steps, or ask for an error, --error";
  const double by_instants = confirmed ? sum_of_instants_.pulses : sum_of_instants_.all,
               others = confirmed ? sum_.pulses : sum_.all;
  if (!(by_instants > too_much_at_instants * largest_momentum_) &&
      !(others + by_instants > too_much * largest_momentum_))
    return {};
  std::ostringstream text;
  text.precision(4);
  text << "forces change fast at kinks or pulses that the formulas show, " << jumps_
       << " times, first before t = " << first_time_;
  if (first_ >= 0) text << " (" << kinks_->names()[static_cast<std::size_t>(first_)] << ")";
  text << ": steps over them do not know them, or are of order 1 only; ask for an error, --error, which "
          "divides the motion there";
  return text.str();
}

}  // namespace diracstep
