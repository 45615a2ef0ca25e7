#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/system/event.hpp>
#include <functional>
#include <vector>

namespace diracstep {

/// Where an event was met.
struct EventHit {
  std::size_t event;  ///< number of it
  Sample sample;
};

/// Finds events between the points of a run.
///
/// A change of sign from one point to the next is followed to its time by a bracketed secant method on the
/// motion between them, which is read by steps of the method (sample_at()): so the time has the order of the
/// method and is solved to round-off.  Where the function vanishes at the start nothing is met there.  Two
/// changes between neighbouring points cancel and are not seen.
class EventSearch {
 public:
  /// Reads the motion at a time between the last two points.
  using Read = std::function<StepReport(double t, Sample& sample)>;

  /// `by_momentum`: the functions are of (t, q, p).
  EventSearch(std::vector<Event> events, bool by_momentum);

  /// The next point of the run.  Events before it are added to hits(), in the order of time, up to the first
  /// that stops the run.  The report of a reading that failed, else one that is ok().
  StepReport see(const Sample& point, const Read& read);

  bool empty() const { return events_.empty(); }
  const std::vector<Event>& events() const { return events_; }
  const std::vector<EventHit>& hits() const { return hits_; }
  /// The last hit ends the run.
  bool stopped() const { return !hits_.empty() && events_[hits_.back().event].stop; }

 private:
  double value(std::size_t event, const Sample& sample) const;
  bool changes(std::size_t event, double from, double to) const;
  StepReport locate(std::size_t event, double value, const Sample& point, const Read& read,
                    EventHit& hit) const;

  std::vector<Event> events_;
  bool by_momentum_;
  double last_time_ = 0.0;
  std::vector<double> last_;  ///< values at the last point; empty before the first
  std::vector<bool>
      met_at_last_;  ///< the last point was the zero, so that the change of sign behind it is none
  std::vector<EventHit> hits_;
};

}  // namespace diracstep
