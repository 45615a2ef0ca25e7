#pragma once

#include <diracstep/core/adaptive/error_control.hpp>
#include <vector>

namespace diracstep {

/// Relative change of q or of p from one sample to another, the larger of the two, in the maximum norm;
/// absolute where a column is zero.
double relative_change(const Sample& from, const Sample& to);

/// The last three runs that got to the end of a motion repeated with finer and finer steps, and what they say
/// of the error of the newest.
///
/// The estimate is Richardson's  |y_a − y_b| / ((h_a/h_b)^p − 1)  with the stated order p, or with the
/// observed one where that falls short of p by more than one.
class Refinement {
 public:
  /// For the error asked for and the stated order of the method.
  Refinement(double error, int order) : error_(error), order_(order) {}

  /// A finer run, whose estimate and observed order are filled in.
  void add(ErrorControlRun& run);

  /// Whether the newest run has the error asked for: 2.5 times the estimate is below it, and the observed
  /// order confirms the stated one to within one; or two refinements in a row changed next to nothing.
  bool accepted() const;

  /// Whether three refinements in a row did not bring the runs closer, coarse runs of any motion aside.
  bool stagnates() const { return stagnant_ >= 3; }

  /// The next step over the newest one.
  double next_factor() const;

 private:
  const ErrorControlRun& newest() const { return runs_.back(); }
  const ErrorControlRun& before() const { return runs_[runs_.size() - 2]; }

  double error_;
  int order_;
  std::vector<ErrorControlRun> runs_;
  int stagnant_ = 0;
};

}  // namespace diracstep
