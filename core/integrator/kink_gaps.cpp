#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/step_division.hpp>
#include <diracstep/core/numerics/scales.hpp>

/// What lies between two kinks of one step, divided by its own error.
namespace diracstep {

namespace {

constexpr std::size_t most_parts_of_a_gap = 128;
constexpr double same_end = 2e-12;  // relative: the places of kinks are round-off below it

/// The lengths from kink to kink of a step, behind a 0 for the way to the first one.
void find_gaps(const std::vector<KinkPassed>& kinks, std::vector<double>& gaps) {
  gaps.assign(1, 0.0);
  for (std::size_t k = 1; k < kinks.size(); ++k) gaps.push_back(std::abs(kinks[k].time - kinks[k - 1].time));
}

double end_apart(const Vector& a, const Vector& b, const Vector& start) {
  const double size = std::max({max_norm(a), max_norm(b), max_norm(start)});
  return size > 0.0 ? max_norm(a - b) / size : 0.0;
}

}  // namespace

/// The size of the next part: what is left, or a part of what lies between two kinks.
double StepDivision::within_gap(double left) const {
  if (passed_.size() >= gaps_.size()) return left;
  const double longest = gaps_[passed_.size()] / static_cast<double>(parts_of_gap_);
  return longest > 0.0 && longest < std::abs(left) ? std::copysign(longest, left) : left;
}

bool StepDivision::follow_in(std::size_t parts, const State& start, Work& work) {
  parts_of_gap_ = parts;
  passed_.clear();
  return follow(start, work);
}

/// Divides what lies between the kinks of the step just solved until twice as many parts lead to the same
/// end.  False where no division leads to an end any more.
bool StepDivision::resolve_gaps(const State& start, Work& work) {
  constexpr std::size_t fewest = 2;
  if (end_at_kinks_ || passed_.size() < fewest) return true;
  for (std::size_t parts = 2;; parts *= 2) {
    const State coarse = sequence_->end();
    const std::vector<double> gaps = gaps_;
    find_gaps(passed_, gaps_);
    if (!follow_in(parts, start, work)) {
      unresolved_ = HUGE_VAL;
      gaps_ = gaps;
      return follow_in(parts / 2, start, work);
    }
    if (passed_.size() < fewest) {  // the whole of it met kinks that its parts do not
      unresolved_ = 0.0;
      return true;
    }
    const State& fine = sequence_->end();
    unresolved_ = std::max(end_apart(fine.q, coarse.q, start.q), end_apart(fine.p, coarse.p, start.p));
    if (unresolved_ <= same_end) {
      unresolved_ = 0.0;
      return true;
    }
    if (parts >= most_parts_of_a_gap) return true;
  }
}

}  // namespace diracstep
