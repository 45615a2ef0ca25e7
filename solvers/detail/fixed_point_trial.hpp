#pragma once

#include <diracstep/core/numerics/snapshot.hpp>
#include <limits>
#include <string>

namespace diracstep::detail {

/// What solves by fixed-point iteration show: whether it is quick enough to go on with, or is given up for
/// Newton's method.
class FixedPointTrial {
 public:
  static constexpr int solves_to_judge = 12;
  /// The first solves of a run have too little history to be guessed well, and do not count.
  static constexpr int solves_without_history = 2;

  bool given_up() const { return given_up_; }
  bool over() const { return solves_ >= solves_to_judge; }
  /// Counts a solve.  The iteration is given up as soon as the solves to be judged take more than `quick`
  /// iterations each, whatever those to come take.
  void add(int iterations, int quick) {
    if (first_solves_ < solves_without_history) {
      ++first_solves_;
      return;
    }
    iterations_ += iterations;
    ++solves_;
    given_up_ = iterations_ > quick * solves_to_judge;
  }
  /// Counts from zero; what was judged stays.
  void count_again() { solves_ = iterations_ = 0; }

  void reset() { *this = {}; }
  void save(Snapshot& to) const {
    to.put("solves that do not count", first_solves_);
    to.put("judged solves", solves_);
    to.put("judged iterations", iterations_);
    to.put("fixed-point iteration given up", given_up_);
  }
  void restore(SnapshotReader& from) {
    first_solves_ = static_cast<int>(from.whole_number("solves that do not count", solves_without_history));
    solves_ = static_cast<int>(from.whole_number("judged solves", solves_to_judge));
    iterations_ = static_cast<int>(from.whole_number("judged iterations", std::numeric_limits<int>::max()));
    given_up_ = from.flag("fixed-point iteration given up");
  }

 private:
  int first_solves_ = 0, solves_ = 0, iterations_ = 0;
  bool given_up_ = false;
};

/// NonlinearSolver::strategy() of a solver that comes to Newton's method, which is described by `newton`, by
/// fixed-point iteration; `measured`: as a trial decides.
inline std::string fixed_point_strategy(bool measured, const std::string& newton) {
  return (measured ? "fixed-point iteration while it is quick; otherwise "
                   : "fixed-point iteration; where it fails ") +
         newton;
}

}  // namespace diracstep::detail
