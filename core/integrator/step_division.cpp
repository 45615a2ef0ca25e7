#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/step_division.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <limits>

namespace diracstep {

namespace {

constexpr std::size_t most_parts_of_a_step = 40;  // and those of gaps_
constexpr int most_tries = 60, most_halvings = 12, most_returns = 2, most_hidden = 8;
constexpr int most_behind = 12, most_crossings = 16;
constexpr double towards_zero = 15.0 / 16.0;  // of the way that is left, in one try from the near side
constexpr double ways_across = 4.0;           // of that way, for the part across
constexpr double nodes_before = 0.005;        // of a part: the way to its end from the last node within it
constexpr double finest_part = 1e-14, returned_within = 1e-6;  // of the step

/// The shortest way to the end of a part that a zero is looked for in.
double finest_of(const Interval& part) {
  return std::max(finest_part * std::abs(part.size),
                  4.0 * std::numeric_limits<double>::epsilon() * std::abs(part.start));
}

}  // namespace

StepDivision::StepDivision(std::shared_ptr<const Scene> scene, double usual_step, bool node_at_end,
                           PointReader& reader, StepSequence& sequence)
    : scene_(std::move(scene)),
      reader_(&reader),
      sequence_(&sequence),
      kinks_(scene_->kinks && scene_->kinks->count() > 0 ? scene_->kinks.get() : nullptr),
      node_at_end_(node_at_end),
      times_(scene_->kinks, scene_->start.time, usual_step) {
  parts_.reserve(4);
}

StepSequence::Outcome StepDivision::solve(Interval step, const State& start, Guess guess, Work& work) {
  (void)times_.divide(step, parts_);
  divided_ = parts_.size() > 1 || parts_.front().size != step.size;
  passed_.clear();
  stuck_.clear();
  gaps_.clear();
  unresolved_ = 0.0;
  if (parts_.size() > 1) guess = Guess::plain;
  sequence_->begin_record();
  StepSequence::Outcome outcome = sequence_->solve(parts_, start, guess, work);
  if (kinks_ == nullptr || (outcome.ok() && !crosses(step, start, sequence_->end()))) return outcome;
  undivided_ = parts_;
  solved_ = {};
  if (follow(start, work) && !passed_.empty() && resolve_gaps(start, work)) {
    divided_ = true;
    return {solved_, {}};
  }
  parts_ = undivided_;
  divided_ = divided_ && stuck_.empty();
  passed_.clear();
  sequence_->begin_record();
  if (!outcome.ok() && !stuck_.empty()) outcome.failure = stuck_;
  // end() is that of the last try.
  return outcome.ok() ? sequence_->solve(parts_, start, Guess::plain, work) : outcome;
}

StepSequence::Outcome StepDivision::solve_finer(int more, const State& start, Work& work) {
  pieces_.clear();
  for (const Interval& part : parts_)
    for (int k = 0; k < more; ++k) pieces_.push_back({part.start + k * (part.size / more), part.size / more});
  return sequence_->solve(pieces_, start, Guess::plain, work);
}

bool StepDivision::solve_part(Interval part, const State& from, Guess guess, Work& work) {
  last_ = sequence_->solve({&part, 1}, from, guess, work).solve;
  if (last_.ok()) read(part.start + part.size, sequence_->end(), true, after_);
  return last_.ok();
}

/// The part solved last is one of the step; the motion goes on from its end.
void StepDivision::keep(const Interval& part, State& from) {
  parts_.push_back(part);
  solved_.add(last_);
  sequence_->keep_record();
  from = sequence_->end();
}

/// Divides the parts at the kinks on the way; false where that cannot be done.
bool StepDivision::follow(const State& start, Work& work) {
  State from = start;
  const double whole = std::abs(undivided_.back().start + undivided_.back().size - undivided_.front().start);
  int crossed = -1, returns = 0, hidden = 0, halvings = 0;
  parts_.clear();
  sequence_->begin_record();
  for (const Interval& given : undivided_)
    for (double left = given.size;;) {
      const double longest = within_gap(left);
      Interval part{given.start + (given.size - left), longest};
      if (parts_.size() >= most_parts_of_a_step + gaps_.size() * parts_of_gap_)
        return give_up(crossed, part.start);
      read_start(part, from, true);
      for (bool first = true; !solve_part(part, from, Guess::plain, work); first = false) {
        if (++halvings > most_halvings) {
          const int number = crossed >= 0 ? crossed : ahead(before_);
          return number >= 0 && give_up(number, part.start);
        }
        const double place = first ? failed_place(part, from) : 0.0;
        part.size *= place > 0.0 ? place : 0.5;
      }
      for (double place = 1.0; place > 0.0 && hidden < most_hidden;) {
        place = hidden_place(part, from, sequence_->end());
        if (place == 0.0) break;
        ++hidden;
        part.size *= place;
        if (!solve_part(part, from, Guess::plain, work)) return false;
      }
      changes_ = (after_ - before_).cwiseAbs();
      int number = first_change(), last = -1;
      if (number < 0 && node_at_end_ &&
          part.size != longest) {  // longer ones fail: for what is at their end?
        number = ahead(after_);
        if (number >= 0 && !shorten_before(number, part, from, work)) {
          number = -1;
          if (!solve_part(part, from, Guess::plain, work)) return false;
        }
        if (number >= 0) {
          last = number;
          number = -1;
        }
      }
      // The part before ended at the zero, to round-off.
      if (number >= 0 && number != crossed && std::abs(part.size) <= finest_part * whole) last = number;
      // Each function once: several vanish together, as those of v > 0 and v < 0, and round-off lets each
      // seem to come first.
      for (int k = 0; k < kinks_->count() && number >= 0 && std::abs(part.size) > finest_part * whole; ++k) {
        last = number;
        if (!(node_at_end_ ? shorten_before(number, part, from, work) : shorten(number, part, from, work)))
          return give_up(number, part.start);
        before_[number] = 0.0;  // crossed at the end; what else changed before it?
        number = part.size == 0.0 ? -1 : first_change();
      }
      const bool returned = last >= 0 && last == crossed && std::abs(part.size) <= returned_within * whole;
      returns = returned ? returns + 1 : 0;
      if (returns == most_returns) return give_up(last, part.start);
      if (last >= 0) crossed = last;
      if (part.size != 0.0) {
        left -= part.size;
        keep(part, from);
      }
      bool ends = std::abs(left) <= finest_part * whole || left * given.size <= 0.0;
      if (last >= 0 && node_at_end_ && !ends) {
        Interval across{given.start + (given.size - left), left};
        if (!cross(last, across, from, work)) return give_up(last, across.start);
        left -= across.size;
        keep(across, from);
        ends = std::abs(left) <= finest_part * whole || left * given.size <= 0.0;
      }
      if (ends) break;
      // A kink come to twice within a round-off is crossed once: no gap lies between.
      if (last >= 0 && !returned) passed_.push_back({given.start + (given.size - left), from});
      if (last >= 0 && end_at_kinks_) return true;
    }
  return true;
}

/// The way across a zero that the part before came to from the near side, of an end that lies behind it:
/// within `across` at most, and a round-off of the time where that is enough.
bool StepDivision::cross(int number, Interval& across, const State& from, Work& work) {
  const double longest = across.size;
  read(across.start, from, true, before_);
  double size = std::copysign(
      std::max(ways_across * to_zero_, 8.0 * std::numeric_limits<double>::epsilon() * std::abs(across.start)),
      longest);
  for (int k = 0; k < most_crossings; ++k, size *= 4.0) {
    across.size = std::abs(size) < std::abs(longest) ? size : longest;
    if (!solve_part(across, from, Guess::plain, work)) continue;
    if (before_[number] * after_[number] <= 0.0 || across.size == longest) return true;
  }
  return false;
}

/// Comes to the zero of one function, within the part solved last, from the near side alone, so that the
/// functions at all nodes are those of the near side: a step over the zero has those of the far side at some,
/// so that its own zero is another one, or no solution.  Ends where the way that is left is below `within` of
/// the part; false where the zero is not found.
bool StepDivision::approach(int number, const Interval& part, const State& from, double within, Approach& to,
                            Work& work) {
  const auto near_side = [&](double value) { return before_[number] * value > 0.0; };
  to = {0.0, before_[number], part.size * before_[number] / (before_[number] - after_[number])};
  double beyond = part.size;  // the shortest size that ends on the far side, where one is known
  if (near_side(after_[number])) {
    if (std::abs(after_[number]) >= std::abs(to.value)) return false;
    to.size = part.size;
    to.value = after_[number];
    beyond = std::copysign(HUGE_VAL, part.size);
  }
  const double finest = finest_of(part);
  Guess guess = to.size == 0.0 ? Guess::plain : Guess::last_solution;
  int behind = 0;
  for (int k = 0;
       k < most_tries && std::abs(to.zero - to.size) > std::max(finest, within * std::abs(to.size)); ++k) {
    const double next = to.size + towards_zero * (to.zero - to.size);
    if (solve_part({part.start, next}, from, guess, work) && near_side(after_[number])) {
      const double slope = (after_[number] - to.value) / (next - to.size);
      to.zero =
          slope * before_[number] * part.size < 0.0 ? next - after_[number] / slope : 2.0 * next - to.size;
      // A motion that turned on the way has the wrong slope; longer steps may end on this side once more.
      if (std::abs(to.zero) > std::abs(beyond)) to.zero = 0.5 * (next + beyond);
      to.size = next;
      to.value = after_[number];
      guess = Guess::last_solution;
      continue;
    }
    if (++behind > most_behind) return false;
    beyond = next;
    to.zero = to.size + 0.5 * (next - to.size);
    guess = Guess::plain;
  }
  return true;
}

/// Shortens a part, which was solved last, so that it ends before the zero of one function by a round-off of
/// the time; its size may become 0.
bool StepDivision::shorten_before(int number, Interval& part, const State& from, Work& work) {
  Approach to;
  if (!approach(number, part, from, 0.0, to, work)) return false;
  to_zero_ = std::abs(to.zero - to.size);
  part.size = to.size;
  return part.size == 0.0 ||
         (solve_part(part, from, Guess::plain, work) && before_[number] * after_[number] > 0.0);
}

/// Shortens a part, which was solved last, so that it ends behind the zero of one function.  Of a method
/// whose nodes lie within its steps, a part that is hardly longer than to the zero has all of them before it.
bool StepDivision::shorten(int number, Interval& part, const State& from, Work& work) {
  const double finest = finest_of(part), whole = part.size, at_whole = after_[number];
  Approach to;
  if (!approach(number, part, from, nodes_before, to, work)) return false;
  const auto solve = [&](double size, Guess guess) {
    part.size = size;
    return solve_part(part, from, guess, work);
  };
  double low = to.size, at_low = to.value, high = to.zero, at_high = to.value;
  const double beyond = std::copysign(std::max(std::abs(to.zero - low), 0.5 * finest), whole);
  for (int k = 0; before_[number] * at_high >= 0.0; ++k) {
    high = low + std::ldexp(beyond, k);
    if (std::abs(high) > std::abs(whole)) {
      high = whole;
      at_high = at_whole;
    } else if (solve(high, Guess::plain)) {
      at_high = after_[number];
    } else {
      return false;
    }
  }
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
