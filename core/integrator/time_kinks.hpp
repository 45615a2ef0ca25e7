#pragma once

#include <diracstep/core/steps/step_data.hpp>
#include <diracstep/core/system/kinks.hpp>
#include <memory>
#include <utility>
#include <vector>

namespace diracstep {

/// Times at which a function of the scene jumps or has a kink whatever the motion (Kinks::instants() of width
/// 0), found a window of many steps at a time as they are needed.  The windows are those of the scene's start
/// and the usual step, so that a run that is gone on with finds the same bits.
class TimeKinks {
 public:
  /// `kinks` may be null.
  TimeKinks(std::shared_ptr<const Kinks> kinks, double start, double usual_step);

  /// The parts of a step between such times, in its direction; the step itself where it holds none.  Next to
  /// a kink parts end and begin a few units of round-off in t beside it, so that none reads both of its
  /// sides.  Whether the step holds such a time, or comes as close to one as its round-off.
  bool divide(Interval step, std::vector<Interval>& parts);

  /// The centres of the pulses and ramps of the time in a step.
  void add_pulses(Interval step, std::vector<double>& times);

 private:
  void look_at_window(double number);
  void add_times(double first, double last);

  std::shared_ptr<const Kinks> kinks_;
  double start_, width_;
  double window_ = 0.0;  ///< number of the one that known_ is of
  bool any_known_ = false;
  std::vector<double> known_, times_, pulses_;  ///< pulses_: those of width above 0
};

}  // namespace diracstep
