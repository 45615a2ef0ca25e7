#pragma once

#include <cmath>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/system/event.hpp>
#include <functional>
#include <optional>
#include <vector>

namespace diracstep {

/// Where an event was met.
struct EventHit {
  std::size_t event;                 ///< number of it
  Sample sample;                     ///< just before it
  std::optional<Sample> after = {};  ///< what it made of it; none where it does not act
  double impulse = 0.0;              ///< Λ_c of a contact, momentum over the unit of its row
  int behind = 0;                    ///< sign of its function behind the zero; 0 for a clock
};

/// Finds events between the points of a run.
///
/// A change of sign from one point to the next is followed to its time by a bracketed secant method on the
/// motion between them, which is read by steps of the method from the first of both: so the time has the
/// order of the method and is solved to round-off.  Where the function vanishes at the start nothing is met
/// there, and changes between values below 1e-13 of the largest so far are round-off.  Changes between
/// neighbouring points that cancel are looked for at seven places on a cubic between them, so that a pair
/// that lies closer than an eighth of a step may not be seen, but for a contact that was just left: there
/// g/(t − t_left) is looked at, which is the rate at t_left, so that a return within the same step is found.
///
/// Where events act, every function that vanishes there has crossed its zero, whatever its last digit says:
/// where what acted turns it back, as a relay at its switching surface, it crosses again.  Events whose times
/// differ by less than 1e-9 of a step are of one instant, and come in the order of the scene.
class EventSearch {
 public:
  /// Reads the motion at a time between the last two points.
  using Read = std::function<StepReport(double t, Sample& sample)>;

  explicit EventSearch(std::vector<Event> events);

  /// The next point of the run.  met() are then the events before it in the order of time, up to the first
  /// that acts or stops the run and those of the same time.  The report of a reading that failed, or of a
  /// function that is not a number, else one that is ok().
  StepReport see(const Sample& point, const Read& read);
  std::vector<EventHit>& met() { return met_; }
  /// The events whose functions vanish where the last of met() acts, whether their conditions hold or not.
  const std::vector<std::size_t>& at_zero() const { return at_zero_; }
  /// Whether a value of the function of one of these is a zero to round-off.
  bool is_zero(std::size_t event, double value) const { return std::abs(value) <= watches_[event].zero; }

  /// Where a run goes on after events that acted: `left` names a contact and the rate at which it was left.
  struct Left {
    std::size_t event;
    double rate;
  };
  /// From this point on those events are looked for that are awake.  The numbers of those that are due at
  /// once: what acted has set their function to the other side of its zero (`by_settings`: it has done
  /// nothing but set values), or they were asleep, and what they wait for has happened.
  std::vector<std::size_t> go_on(const Sample& point, const std::vector<Left>& left,
                                 const std::vector<bool>& awake, bool by_settings);

  bool empty() const { return events_.empty(); }
  const std::vector<Event>& events() const { return events_; }

  void save(Snapshot& to) const;
  void restore(SnapshotReader& from, const std::vector<bool>& awake);
  /// After restore(), the point at which it was saved.
  void stand_at(const Sample& point) { last_point_ = point; }

 private:
  struct Watch {
    bool awake = true;
    double last = 0.0;         ///< value at the last point where it was not 0
    bool met_at_last = false;  ///< the last point was the zero: the change of sign behind it is none
    bool left = false;         ///< a contact that was left at the last point, at the rate `last`
    double ticks = 0.0;        ///< of a clock so far
    double largest = 0.0;      ///< value so far, without sign: far smaller ones are round-off
    int behind = 0;            ///< its sign behind the zero at which events act; 0 where it does not vanish
    double zero = 0.0;         ///< what its value may be there
    double at_act = 0.0;       ///< its value where events act, before or between them; 0 where it vanishes
  };
  /// An event's function between two points, bracketed.
  struct Bracket {
    double before, after;
    double at_before, at_after;
    bool divided;  ///< by the time since the last point
  };

  StepReport begin(const Sample& point);
  StepReport value(std::size_t event, const Sample& sample, double& value) const;
  bool changes(std::size_t event, double from, double to) const;
  StepReport look(std::size_t event, double here, const Sample& point, const Read& read);
  void set_clock(std::size_t event, double t);
  std::vector<double> times_of_changes(std::size_t event, double here, const Sample& point) const;
  StepReport look_at(const std::vector<double>& times, std::size_t event, double here, const Sample& point,
                     const Read& read);
  StepReport tick(std::size_t event, const Sample& point, const Read& read);
  StepReport locate(Bracket bracket, const Sample& point, const Read& read, EventHit& hit) const;
  bool keep_first_that_acts(const Sample& point);
  void mark_zeros(const Sample& at);
  bool turned_back(std::size_t event, double rate);

  std::vector<Event> events_;
  std::vector<Watch> watches_;
  bool begun_ = false;
  double start_ = 0.0, last_time_ = 0.0;
  Sample last_point_;  ///< of no size where it is not known
  std::vector<EventHit> met_;
  std::vector<std::size_t> at_zero_;
};

}  // namespace diracstep
