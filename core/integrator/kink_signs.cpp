#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/step_division.hpp>
#include <diracstep/core/spaces/space.hpp>

/// Which kinks a part of a step crosses, by the signs of the switching functions.
namespace diracstep {

namespace {

constexpr double little_ahead = 1e-6;               // of a step
constexpr double nearly_all = 0.98, shorter = 0.9;  // of a step
constexpr double reach_of_estimates = 2.0;          // in changes within a step
constexpr double reach_of_motion = 2.0;             // in changes within the part before

}  // namespace

/// By the velocity of the class of p, or by its estimate: where rows act, that is not of the method's order.
void StepDivision::read(double t, const State& at, bool exactly, Vector& switches) {
  velocity_ = at.v;
  if (exactly && !reader_->velocity(t, at.q, at.p, velocity_).ok()) velocity_ = at.v;
  switches.resize(kinks_->count());
  kinks_->evaluate(t, at.q, velocity_, switches);
}

/// before_ and the velocity at the start of a step; where a function is zero there, as of a motion that
/// begins at a contact, its value a little ahead, whose sign is that of the side that the motion goes to.
void StepDivision::read_start(const Interval& step, const State& from, bool exactly) {
  read(step.start, from, exactly, before_);
  start_velocity_ = velocity_;
  if ((before_.array() != 0.0).all() || scene_->space) return;
  between_.resize(kinks_->count());
  const double time = little_ahead * step.size;
  position_ = from.q + time * velocity_;
  kinks_->evaluate(step.start + time, position_, velocity_, between_);
  for (Eigen::Index k = 0; k < before_.size(); ++k)
    if (before_[k] == 0.0) before_[k] = between_[k];
}

/// The number of a kink that lies between before_ and after_; -1 where none.
int StepDivision::first_change() const {
  for (Eigen::Index k = 0; k < after_.size(); ++k)
    if (kinks_->kinds()[static_cast<std::size_t>(k)] == Kinks::Kind::kink && before_[k] * after_[k] < 0.0)
      return static_cast<int>(k);
  return -1;
}

/// The number of a kink at which the motion comes to be soon, by its change within the part solved last; -1
/// where none.
int StepDivision::ahead(const Vector& here) const {
  if (changes_.size() != here.size()) return -1;
  for (Eigen::Index k = 0; k < here.size(); ++k)
    if (kinks_->kinds()[static_cast<std::size_t>(k)] == Kinks::Kind::kink &&
        std::abs(here[k]) <= reach_of_motion * changes_[k])
      return static_cast<int>(k);
  return -1;
}

/// The acceleration by the forces at the start, which those behind a kink are no part of: the end of a step
/// that has taken these in tells nothing of it.  Zero where it is not to be taken.
void StepDivision::find_acceleration(Interval step, const State& start) {
  acceleration_.setZero(start.v.size());
  if (!takes_acceleration_) return;
  force_.resize(start.v.size());
  momentum_.resize(start.v.size());
  scene_->force_and_momentum(step.start, start.q, start_velocity_, start.p, force_, momentum_);
  momentum_ = start.p + step.size * force_;
  if (scene_->force) {
    scene_->force->value(step.start, start.q, start_velocity_, force_);
    momentum_ += step.size * force_;
  }
  speed_ = start_velocity_;
  if (!momentum_.allFinite() || !reader_->velocity(step.start, start.q, momentum_, speed_).ok()) return;
  if (speed_.allFinite()) acceleration_ = (speed_ - start_velocity_) / step.size;
}

/// Just behind where the motion would cross a kink first with its velocity and acceleration at the start of a
/// step, in parts of it, whether the end of the step is on this side again or on the other: a step far too
/// large for what is behind the kink turns back within itself, and where it ends tells nothing of the first
/// crossing.  Without an acceleration for ends on this side alone.  0 where it would not.
double StepDivision::place_ahead(Interval step, const State& start) {
  constexpr int halvings = 12;
  constexpr double quarter = 0.25;
  const auto crosses_by = [&](double place, bool any) {
    const double time = place * step.size;
    position_ = time * start_velocity_ + (0.5 * time * time) * acceleration_;
    if (scene_->space)
      position_ = scene_->space->moved(start.q, position_);
    else
      position_ += start.q;
    speed_ = start_velocity_ + time * acceleration_;
    kinks_->evaluate(step.start + time, position_, speed_, between_);
    for (Eigen::Index k = 0; k < between_.size(); ++k)
      if (kinks_->kinds()[static_cast<std::size_t>(k)] == Kinks::Kind::kink &&
          (any || before_[k] * after_[k] > 0.0) && between_[k] * before_[k] < 0.0)
        return true;
    return false;
  };
  between_.resize(kinks_->count());
  const bool any = takes_acceleration_;
  double low = 0.0, high = quarter;
  for (; high < 1.0 && !crosses_by(high, any); high += quarter) low = high;
  if (high == 1.0 && !crosses_by(1.0, any)) return 0.0;
  for (int k = 0; k < halvings; ++k) {
    const double place = 0.5 * (low + high);
    (crosses_by(place, any) ? high : low) = place;
  }
  if (!crosses_by(high, false)) return high < shorter ? high / nearly_all : 0.0;
  return high < nearly_all ? high / nearly_all : shorter;
}

/// Of a step that has no solution, as one deep into a stiff wall: just behind where the motion comes to a
/// kink first, or 0.
double StepDivision::failed_place(Interval step, const State& start) {
  if (!takes_acceleration_) return 0.0;
  after_ = before_;
  find_acceleration(step, start);
  return place_ahead(step, start);
}

/// Where between the ends of a step, in parts of it, a kink is on another side than at both; 0 where none.
double StepDivision::hidden_place(Interval step, const State& start, const State& end) {
  find_acceleration(step, start);
  if (const double place = place_ahead(step, start); place > 0.0) return place;
  if (scene_->space) return 0.0;  // points that cannot be subtracted
  velocity_ = (end.q - start.q) / step.size;
  speed_up_ = velocity_ - start.v;  // in the time of the step
  for (const double place : {0.5, 0.25, 0.75}) {
    position_ = start.q + place * step.size * velocity_ - 0.5 * place * (1.0 - place) * step.size * speed_up_;
    between_.resize(kinks_->count());
    speed_ = velocity_ + (place - 0.5) * speed_up_;
    kinks_->evaluate(step.start + place * step.size, position_, speed_, between_);
    bool nearer = false;
    for (Eigen::Index k = 0; k < between_.size(); ++k) {
      if (kinks_->kinds()[static_cast<std::size_t>(k)] != Kinks::Kind::kink ||
          !(before_[k] * after_[k] > 0.0))
        continue;
      if (between_[k] * before_[k] < 0.0) return place;
      nearer = nearer || std::abs(between_[k]) < 0.5 * std::min(std::abs(before_[k]), std::abs(after_[k]));
    }
    if (!nearer) return 0.0;  // what is no nearer to zero in the middle is taken to have none
  }
  return 0.0;
}

bool StepDivision::crosses(Interval step, const State& start, const State& end) {
  const double end_time = step.start + step.size;
  read_start(step, start, false);
  read(end_time, end, false, after_);
  changes_ = (after_ - before_).cwiseAbs();
  if (hidden_place(step, start, end) > 0.0) return true;
  const auto nearest = before_.cwiseAbs().cwiseMin(after_.cwiseAbs()).array();
  const auto change = (after_ - before_).cwiseAbs().array();
  if (!(before_.array() * after_.array() <= 0.0 || nearest <= reach_of_estimates * change).any())
    return false;
  read_start(step, start, true);
  read(end_time, end, true, after_);
  return first_change() >= 0;
}

}  // namespace diracstep
