#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/step_division.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <limits>

namespace diracstep {

namespace {

constexpr std::size_t most_parts_of_a_step = 40;
constexpr int most_tries = 60, most_halvings = 12, most_returns = 2, most_hidden = 4;
constexpr double finest_part = 1e-14, returned_within = 1e-6;  // of the step
constexpr double reach_of_estimates = 2.0;                     // in changes within a step
constexpr double reach_of_motion = 2.0;                        // in changes within the part before

}  // namespace

StepDivision::StepDivision(std::shared_ptr<const Scene> scene, double usual_step, PointReader& reader,
                           StepSequence& sequence)
    : scene_(std::move(scene)),
      reader_(&reader),
      sequence_(&sequence),
      kinks_(scene_->kinks && scene_->kinks->count() > 0 ? scene_->kinks.get() : nullptr),
      times_(scene_->kinks, scene_->start.time, usual_step) {
  parts_.reserve(4);
}

/// By the velocity of the class of p, or by its estimate: where rows act, that is not of the method's order.
void StepDivision::read(double t, const State& at, bool exactly, Vector& switches) {
  velocity_ = at.v;
  if (exactly && !reader_->velocity(t, at.q, at.p, velocity_).ok()) velocity_ = at.v;
  switches.resize(kinks_->count());
  kinks_->evaluate(t, at.q, velocity_, switches);
}

/// The number of a kink that lies between before_ and after_; -1 where none.
int StepDivision::first_change() const {
  for (Eigen::Index k = 0; k < after_.size(); ++k)
    if (kinks_->kinds()[static_cast<std::size_t>(k)] == Kinks::Kind::kink && before_[k] * after_[k] < 0.0)
      return static_cast<int>(k);
  return -1;
}

/// The number of a kink that the motion comes to, or comes from, by its change within the part solved last;
/// -1 where none.
int StepDivision::ahead() const {
  if (changes_.size() != before_.size()) return -1;
  for (Eigen::Index k = 0; k < before_.size(); ++k)
    if (kinks_->kinds()[static_cast<std::size_t>(k)] == Kinks::Kind::kink &&
        std::abs(before_[k]) <= reach_of_motion * changes_[k])
      return static_cast<int>(k);
  return -1;
}

/// Where between the ends of a step, in parts of it, a kink is on another side than at both; 0 where none.
double StepDivision::hidden_place(Interval step, const State& start, const State& end) {
  if (start.q.size() != start.v.size()) return 0.0;  // points that cannot be subtracted
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
  read(step.start, start, false, before_);
  read(end_time, end, false, after_);
  changes_ = (after_ - before_).cwiseAbs();
  if (hidden_place(step, start, end) > 0.0) return true;
  const auto nearest = before_.cwiseAbs().cwiseMin(after_.cwiseAbs()).array();
  const auto change = (after_ - before_).cwiseAbs().array();
  if (!(before_.array() * after_.array() <= 0.0 || nearest <= reach_of_estimates * change).any())
    return false;
  read(step.start, start, true, before_);
  read(end_time, end, true, after_);
  return first_change() >= 0;
}

StepSequence::Outcome StepDivision::solve(Interval step, const State& start, Guess guess, Work& work) {
  times_.divide(step, parts_);
  divided_ = parts_.size() > 1 || parts_.front().size != step.size;
  passed_.clear();
  stuck_.clear();
  if (parts_.size() > 1) guess = Guess::plain;
  StepSequence::Outcome outcome = sequence_->solve(parts_, start, guess, work);
  if (kinks_ == nullptr || (outcome.ok() && !crosses(step, start, sequence_->end()))) return outcome;
  undivided_ = parts_;
  const bool followed = follow(start, work);
  if (followed && !passed_.empty()) {
    StepSequence::Outcome in_parts = sequence_->solve(parts_, start, Guess::plain, work);
    if (in_parts.ok()) {
      divided_ = true;
      return in_parts;
    }
  }
  parts_ = undivided_;
  divided_ = divided_ && stuck_.empty();
  passed_.clear();
  // end() is that of the last try.
  return outcome.ok() ? sequence_->solve(parts_, start, Guess::plain, work) : outcome;
}

/// Divides the parts at the kinks on the way; false where that cannot be done.
bool StepDivision::follow(const State& start, Work& work) {
  State from = start;
  const double whole = std::abs(undivided_.back().start + undivided_.back().size - undivided_.front().start);
  int crossed = -1, returns = 0, hidden = 0, halvings = 0;
  parts_.clear();
  for (const Interval& given : undivided_)
    for (double left = given.size;;) {
      Interval part{given.start + (given.size - left), left};
      if (parts_.size() == most_parts_of_a_step) return give_up(crossed, part.start);
      read(part.start, from, true, before_);
      while (!sequence_->solve({&part, 1}, from, Guess::plain, work).ok()) {
        if (++halvings > most_halvings) {
          const int number = crossed >= 0 ? crossed : ahead();
          return number >= 0 && give_up(number, part.start);
        }
        part.size *= 0.5;
      }
      read(part.start + part.size, sequence_->end(), true, after_);
      if (const double place =
              first_change() < 0 && hidden < most_hidden ? hidden_place(part, from, sequence_->end()) : 0.0;
          place > 0.0) {
        ++hidden;
        part.size *= place;
        if (!sequence_->solve({&part, 1}, from, Guess::plain, work).ok()) return false;
        read(part.start + part.size, sequence_->end(), true, after_);
      }
      changes_ = (after_ - before_).cwiseAbs();
      int number = first_change(), last = -1;
      // Each function once: several vanish together, as those of v > 0 and v < 0, and round-off lets each
      // seem to come first.
      for (int k = 0; k < kinks_->count() && number >= 0 && std::abs(part.size) > finest_part * whole; ++k) {
        last = number;
        if (!shorten(number, part, from, work)) return give_up(number, part.start);
        before_[number] = 0.0;  // crossed at the end; what else changed before it?
        number = first_change();
      }
      const bool returned = last >= 0 && last == crossed && std::abs(part.size) <= returned_within * whole;
      returns = returned ? returns + 1 : 0;
      if (returns == most_returns) return give_up(last, part.start);
      if (last >= 0) crossed = last;
      left -= part.size;
      const bool ends = std::abs(left) <= finest_part * whole || left * part.size <= 0.0;
      parts_.push_back(part);
      from = sequence_->end();
      if (ends) break;
      if (last >= 0) passed_.push_back({part.start + part.size, from});
    }
  return true;
}

/// Shortens a part, which was solved last, so that it ends behind the zero of one function.
bool StepDivision::shorten(int number, Interval& part, const State& from, Work& work) {
  double low = 0.0, high = part.size, at_low = before_[number], at_high = after_[number];
  const double finest = std::max(finest_part * std::abs(part.size),
                                 4.0 * std::numeric_limits<double>::epsilon() * std::abs(part.start));
  const auto solve = [&](double size, Guess guess) {
    part.size = size;
    if (!sequence_->solve({&part, 1}, from, guess, work).ok()) return false;
    read(part.start + size, sequence_->end(), true, after_);
    return true;
  };
  for (int k = 0; k < most_tries && std::abs(high - low) > finest; ++k) {
    double next = k % 3 == 2 ? 0.5 * (low + high) : low - at_low * (high - low) / (at_high - at_low);
    const double margin = std::min(0.5 * finest, 0.25 * std::abs(high - low));  // so that both ends close in
    next = std::clamp(next, std::min(low, high) + margin, std::max(low, high) - margin);
    if (!solve(next, Guess::last_solution) && !solve(next, Guess::plain)) return false;
    const bool behind = before_[number] * after_[number] < 0.0;
    (behind ? high : low) = next;
    (behind ? at_high : at_low) = after_[number];
  }
  return part.size == high || solve(high, Guess::plain);
}

/// `number` is the kink that was crossed last, or -1: then the one nearest.
bool StepDivision::give_up(int number, double t) {
  if (number < 0) before_.cwiseAbs().minCoeff(&number);
  stuck_ = "from t = " + to_text(t, 6) + " the motion crosses " +
           kinks_->names()[static_cast<std::size_t>(number)] +
           " again and again: the force there points back from both sides, as that of dry friction at rest, "
           "and lets no step pass; write one that is steep instead of a jump, as tanh(v/eps)";
  return false;
}

}  // namespace diracstep
