#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/step_division.hpp>
#include <diracstep/core/numerics/scales.hpp>

/// What lies between two kinks of one step, divided by its own error.
namespace diracstep {

namespace {

constexpr std::size_t most_parts_of_a_gap = 128;
constexpr double shortest_part = 1e-12;  // of what is left of a step: kinks closer than that are met at once
constexpr double same_end = 2e-12;       // relative: the places of kinks are round-off below it

/// The lengths from kink to kink of a step, behind a 0 for the way to the first one.
void find_gaps(const std::vector<KinkPassed>& kinks, std::vector<double>& gaps) {
  gaps.assign(1, 0.0);
  for (std::size_t k = 1; k < kinks.size(); ++k) gaps.push_back(std::abs(kinks[k].time - kinks[k - 1].time));
}

double end_apart(const Vector& a, const Vector& b, const Vector& start) {
  const double size = std::max({max_norm(a), max_norm(b), max_norm(start)});
  return size > 0.0 ? max_norm(a - b) / size : 0.0;
}

double states_apart(const State& a, const State& b, const State& start) {
  return std::max(end_apart(a.q, b.q, start.q), end_apart(a.p, b.p, start.p));
}

}  // namespace

/// The size of the next part: what is left, or a part of what lies between two kinks.
double StepDivision::within_gap(double left) const {
  if (passed_.size() >= gaps_.size()) return left;
  const double longest = gaps_[passed_.size()] / static_cast<double>(parts_of_gap_);
  const bool divides = longest > shortest_part * std::abs(left) && longest < std::abs(left);
  return divides ? std::copysign(longest, left) : left;
}

bool StepDivision::follow_in(std::size_t parts, const State& start, Work& work) {
  parts_of_gap_ = parts;
  passed_.clear();
  return follow(start, work);
}

/// How far the ends of a part and of two halves of it are apart.
double StepDivision::error_of(const Interval& part, const State& from, Work& work) {
  if (part.size == 0.0) return 0.0;
  const double half = 0.5 * part.size;
  const Interval halves[] = {{part.start, half}, {part.start + half, half}};
  if (!sequence_->solve(halves, from, Guess::plain, work).ok()) return HUGE_VAL;
  const State fine = sequence_->end();
  if (!sequence_->solve({&part, 1}, from, Guess::plain, work).ok()) return HUGE_VAL;
  return states_apart(fine, sequence_->end(), from);
}

/// Whether the ways to the first kink and from the last one are to be divided, too.
bool StepDivision::find_ends(const State& start, Work& work) {
  constexpr double beside_the_other = 10.0;
  divides_head_ = divides_tail_ = false;
  allowed_ = same_end;
  if (!divides_ways_ || undivided_.size() > 1) return false;
  const State end = sequence_->end();
  const Interval& whole = undivided_.front();
  const KinkPassed& last = passed_.back();
  const double head = error_of({whole.start, passed_.front().time - whole.start}, start, work),
               tail = error_of({last.time, whole.start + whole.size - last.time}, last.at, work);
  sequence_->end() = end;
  sequence_->drop_unkept();
  allowed_ = std::max(same_end, beside_the_other * std::min(head, tail));
  divides_head_ = head > allowed_;
  divides_tail_ = tail > allowed_;
  return divides_head_ || divides_tail_;
}

/// Divides what lies between the kinks of the step just solved until twice as many parts lead to the same
/// end.  False where no division leads to an end any more.
bool StepDivision::resolve_gaps(const State& start, Work& work) {
  if (end_at_kinks_ || passed_.empty()) return true;
  const std::size_t fewest = find_ends(start, work) ? 1 : 2;
  if (passed_.size() < fewest) return true;
  for (std::size_t parts = 2;; parts *= 2) {
    const State coarse = sequence_->end();
    const std::vector<double> gaps = gaps_;
    find_gaps(passed_, gaps_);
    const Interval& whole = undivided_.front();
    if (divides_head_) gaps_.front() = std::abs(passed_.front().time - whole.start);
    if (divides_tail_) gaps_.push_back(std::abs(whole.start + whole.size - passed_.back().time));
    if (!follow_in(parts, start, work)) {
      unresolved_ = HUGE_VAL;
      gaps_ = gaps;
      return follow_in(parts / 2, start, work);
    }
    if (passed_.size() < fewest) {  // the whole of it met kinks that its parts do not
      unresolved_ = 0.0;
      return true;
    }
    unresolved_ = states_apart(sequence_->end(), coarse, start);
    if (unresolved_ <= allowed_) {
      unresolved_ = 0.0;
      return true;
    }
    if (parts >= most_parts_of_a_gap) return true;
  }
}

}  // namespace diracstep
