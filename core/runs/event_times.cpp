#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/path_cubic.hpp>
#include <diracstep/core/runs/event_search.hpp>
#include <limits>

/// When the events of an EventSearch happen between two points.
namespace diracstep {

namespace {

constexpr int most_readings = 100, places_between = 8;
constexpr double round_off_of_time = 4.0 * std::numeric_limits<double>::epsilon();
constexpr double apart_in_time = 1e-9;  // in steps

/// How often a clock has ticked at t; ticks within round-off of t have.
double ticks_at(double t, double start, double every) {
  const double passed = std::abs(t - start);
  const double round_off =
      16.0 * std::numeric_limits<double>::epsilon() * std::max(std::abs(t), std::abs(start));
  double ticks = std::floor(passed / every);
  while ((ticks + 1.0) * every <= passed + round_off && ticks + 1.0 > ticks) ticks += 1.0;
  return ticks;
}

}  // namespace

void EventSearch::set_clock(std::size_t event, double t) {
  watches_[event].ticks = ticks_at(t, start_, events_[event].every);
}

/// The times of a clock between the last point and this one.
StepReport EventSearch::tick(std::size_t event, const Sample& point, const Read& read) {
  Watch& watch = watches_[event];
  const double step = point.time - last_time_;
  constexpr double most_ticks = 1e5;  // between two points
  if (std::abs(step) > most_ticks * events_[event].every) {
    StepReport report;
    report.solve.status = SolveStatus::refused;
    report.failure = "event '" + events_[event].name + "' happens every " + to_text(events_[event].every) +
                     ", more than " + to_text(most_ticks) + " times in a step of " + to_text(std::abs(step));
    return report;
  }
  for (double ticks = watch.ticks + 1.0;; ticks += 1.0) {  // counted where they are kept
    const double t = start_ + std::copysign(ticks * events_[event].every, step);
    const double left = (point.time - t) / step;
    if (!(left > -apart_in_time)) return {};
    EventHit hit{event, point};
    if (left > apart_in_time)
      if (StepReport report = read(t, hit.sample); !report.ok()) return report;
    met_.push_back(std::move(hit));
    if (events_[event].acts()) return {};
  }
}

/// Times to read the function at, where its values at places on a cubic between the last two points change
/// their sign more often than the ends show; else none.
std::vector<double> EventSearch::times_of_changes(std::size_t event, double here, const Sample& point) const {
  if (last_point_.q.size() != point.v.size() || last_point_.lambda.size() != point.lambda.size() ||
      point.time == last_time_)
    return {};
  const PathPoint from{last_time_, last_point_.q, last_point_.v, last_point_.p},
      to{point.time, point.q, point.v, point.p};
  const PathCubic path{from, to};
  std::vector<double> times;
  Sample between;
  double value = watches_[event].last;
  int changes = value * here < 0.0 || here == 0.0 ? -1 : 0;
  for (int k = 1; k <= places_between; ++k) {
    const double part = static_cast<double>(k) / places_between;
    double there = here;
    if (k < places_between) {
      between.time = last_time_ + part * (point.time - last_time_);
      path.at(between.time, between.q, between.v);
      path.momentum_at(between.time, between.p);
      between.lambda = last_point_.lambda + part * (point.lambda - last_point_.lambda);
      there = events_[event].at(between.point());
      times.push_back(between.time);
    }
    if (std::isnan(there)) return {};
    if (value * there < 0.0 || (there == 0.0 && value != 0.0)) ++changes;
    value = there;
  }
  return changes > 0 ? times : std::vector<double>{};
}

/// The changes of sign between these times, one in each part at most.
StepReport EventSearch::look_at(const std::vector<double>& times, std::size_t event, double here,
                                const Sample& point, const Read& read) {
  const Watch& watch = watches_[event];
  double before = last_time_, at_before = watch.met_at_last ? 0.0 : watch.last;
  for (std::size_t k = 0; k <= times.size(); ++k) {
    const bool last = k == times.size();
    Sample there = point;
    double value_there = here;
    if (!last) {
      if (StepReport report = read(times[k], there); !report.ok()) return report;
      if (StepReport report = value(event, there, value_there); !report.ok()) return report;
    }
    if (changes(event, at_before, value_there)) {
      EventHit hit{event, {}};
      StepReport report = locate({before, there.time, at_before, value_there, false}, there, read, hit);
      if (!report.ok()) return report;
      met_.push_back(std::move(hit));
      if (events_[event].acts() || events_[event].stop) return {};
    }
    if (value_there == 0.0) continue;
    before = there.time;
    at_before = value_there;
  }
  return {};
}

/// The Illinois method: the end of the bracket at or behind the zero is the hit.  A guess next to an end is
/// taken a little inside, so that the bracket closes at once where the guesses have converged.
StepReport EventSearch::locate(Bracket bracket, const Sample& point, const Read& read, EventHit& hit) const {
  auto& [before, after, at_before, at_after, divided] = bracket;
  hit.sample = point;
  hit.behind = at_before < 0.0 ? 1 : -1;
  const double smallest = round_off_of_time * std::max(std::abs(before), std::abs(after));
  int side = 0;
  for (int k = 0; k < most_readings && std::abs(after - before) > 2.0 * smallest && at_after != 0.0; ++k) {
    const double sense = after > before ? 1.0 : -1.0;
    double t = after - at_after * (after - before) / (at_after - at_before);
    if (k % 8 == 7 || !std::isfinite(t)) t = before + 0.5 * (after - before);
    t = sense * std::clamp(sense * t, sense * before + smallest, sense * after - smallest);
    Sample between;
    if (StepReport report = read(t, between); !report.ok()) return report;
    double there = 0.0;
    if (StepReport report = value(hit.event, between, there); !report.ok()) return report;
    if (divided) there /= t - last_time_;
    if ((there < 0.0) == (at_before < 0.0) && there != 0.0) {
      before = t;
      at_before = there;
      if (side == -1) at_after *= 0.5;
      side = -1;
    } else {
      after = t;
      at_after = there;
      hit.sample = std::move(between);
      if (side == 1) at_before *= 0.5;
      side = 1;
    }
  }
  return {};
}

}  // namespace diracstep
