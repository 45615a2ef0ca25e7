#pragma once

#include <limits>
#include <string>
#include <vector>

namespace diracstep {

/// Judges a sequence of runs of one motion with finer and finer steps, h_0 > h_1 > …, by the differences
/// d_k = |y_k − y_{k−1}| of their ends.
///
/// The order observed over three runs solves  d_{k−1}/d_k = (h_{k−2}^p − h_{k−1}^p)/(h_{k−1}^p − h_k^p), and
/// the error of the last run is estimated by Richardson's  d_k / ((h_{k−1}/h_k)^p − 1)  with the stated
/// order, or the lower of the last two observed ones where that falls short.
///
/// One agreement may be chance.  Accepted is a sequence whose last run has
///
///  * two observed orders in a row that agree with the stated one to within one, or half of one for orders
///    below 3, with falling differences, and 2.5 times the estimate below the error asked for; or
///  * two differences in a row, those of three runs, below the error asked for divided by 2.5, and 2.5 times
///    the estimate as well, with an observed order of 0.5 at least; where the steps of two runs are in a
///    ratio r above 0.7, their difference counts 0.3/(1 − r) times, since runs of any order agree whose steps
///    are nearly the same; or
///  * two differences in a row that are round-off: there is no order to observe.  Either all are, as where
///    the method is exact for the motion, or the runs have come to round-off; or
///  * three refinements in a row that did not halve the difference, ten times the largest of which is below
///    the error asked for: round-off that the motion or the linear systems amplify.  That is the estimate.
///
/// Runs that are equal without an order, above round-off, are not believed.
///
/// The runs need not come in this order: one between two others may be cheaper than a finer one and says as
/// much of the order.
///
/// What all runs of a sequence step over alike, it does not see: see ForceSurvey.
class Convergence {
 public:
  /// Without `extrapolates` the error of a run is its whole difference from the one before.
  Convergence(int order, double error, bool extrapolates = true)
      : order_(order), error_(error), extrapolates_(extrapolates) {}

  /// The next run, of a smaller step than those before it, its difference from the last one, and what
  /// rounding adds up to in it, in the same unit; the difference of the first is not used.
  void add(double step, double difference, double round_off);
  /// A run between two, `later` of which have smaller steps, at least one; its differences from its
  /// neighbours.
  void insert(std::size_t later, double step, double from_coarser, double from_finer);
  void clear();

  std::size_t runs() const { return steps_.size(); }
  double difference() const { return differences_.empty() ? none : differences_.back(); }
  double estimate() const { return estimate_; }               ///< NaN before the second run
  double observed_order() const { return order_of(runs()); }  ///< NaN before the third

  bool accepted() const { return by_order() || by_three_runs() || at_round_off() || by_stagnation(); }
  /// Why an accepted sequence is believed, in words: "observed order 8.0".
  std::string grounds() const;
  /// Whether the last two differences are round-off, and below the error asked for.
  bool at_round_off() const;
  /// Whether the last run would be accepted if one more between the last runs confirmed it: how many of them
  /// have smaller steps than that one, 0 where none would help.
  std::size_t confirmed_by_run_before() const;
  /// The better of the last two orders observed; 0 before there are two.
  double better_order() const;
  /// Whether the last two observed orders agree with the stated one.
  bool order_confirmed() const { return confirmed(runs()) && confirmed(runs() - 1); }
  /// Three refinements in a row that did not halve the difference.
  bool stagnates() const { return stagnant_ >= stagnant_runs; }
  /// The last difference is one of round-off alone, or small and not halved by the last refinement: orders
  /// and the work to go mean nothing then.
  bool near_round_off() const;
  /// Factor of the next step, from 0.35 to 0.7.
  double next_factor() const;
  /// Part of the work of the last run that one which meets the error would take, by the better of the last
  /// two orders observed: before steps resolve the motion the orders tell nothing.
  double work_to_go() const;
  /// Why the sequence is not accepted, in words.
  std::string obstacle() const;

 private:
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();
  static constexpr std::size_t stagnant_runs = 3;
  double order_of(std::size_t runs) const;
  bool confirmed(std::size_t runs) const;
  void judge();
  /// Of steps_[k] and the run before.
  double ratio(std::size_t k) const { return steps_[k] / steps_[k - 1]; }
  bool agree(std::size_t k, double ratio) const;
  bool agree(std::size_t k) const { return agree(k, ratio(k)); }
  bool by_order() const;
  bool by_three_runs() const;
  bool by_stagnation() const;
  double largest_since_stagnation() const;

  int order_;
  double error_;
  bool extrapolates_;
  std::vector<double> steps_, differences_;  ///< differences_[k − 1] belongs to steps_[k]
  double estimate_ = none;
  double round_off_ = 0.0;  ///< of the last run
  std::size_t stagnant_ = 0;
};

}  // namespace diracstep
