#include <algorithm>
#include <cmath>
#include <diracstep/core/runs/event_search.hpp>
#include <limits>

namespace diracstep {

namespace {

constexpr int most_readings = 100;
constexpr double round_off_of_times = 4.0 * std::numeric_limits<double>::epsilon();

}  // namespace

EventSearch::EventSearch(std::vector<Event> events, bool by_momentum)
    : events_(std::move(events)), by_momentum_(by_momentum) {}

double EventSearch::value(std::size_t event, const Sample& sample) const {
  return events_[event].at(sample.time, sample.q, by_momentum_ ? sample.p : sample.v);
}

bool EventSearch::changes(std::size_t event, double from, double to) const {
  const Event::Direction direction = events_[event].direction;
  const bool rising = from < 0.0 && to >= 0.0, falling = from > 0.0 && to <= 0.0;
  return (rising && direction != Event::Direction::falling) ||
         (falling && direction != Event::Direction::rising);
}

StepReport EventSearch::see(const Sample& point, const Read& read) {
  std::vector<EventHit> met;
  for (std::size_t k = 0; k < events_.size(); ++k) {
    const double here = value(k, point);
    if (last_.size() <= k) {
      last_.push_back(here);
      met_at_last_.push_back(false);
      continue;
    }
    const bool change = changes(k, last_[k], here);
    if (change && !met_at_last_[k]) {
      EventHit hit{k, {}};
      if (StepReport report = locate(k, here, point, read, hit); !report.ok()) return report;
      met.push_back(std::move(hit));
    }
    met_at_last_[k] = change && here == 0.0;
    if (here != 0.0) last_[k] = here;
  }
  const double sense = point.time >= last_time_ ? 1.0 : -1.0;
  std::ranges::stable_sort(met, {}, [&](const EventHit& hit) { return sense * hit.sample.time; });
  for (EventHit& hit : met) {
    hits_.push_back(std::move(hit));
    if (stopped()) break;
  }
  last_time_ = point.time;
  return {};
}

/// The Illinois method: the end of the bracket at or behind the zero is the hit.  A guess next to an end is
/// taken a little inside, so that the bracket closes at once where the guesses have converged.
StepReport EventSearch::locate(std::size_t event, double here, const Sample& point, const Read& read,
                               EventHit& hit) const {
  double before = last_time_, after = point.time, at_before = last_[event], at_after = here;
  hit.sample = point;
  const double smallest = round_off_of_times * std::max(std::abs(before), std::abs(after));
  int side = 0;
  for (int k = 0; k < most_readings && std::abs(after - before) > 2.0 * smallest && at_after != 0.0; ++k) {
    const double sense = after > before ? 1.0 : -1.0;
    double t = after - at_after * (after - before) / (at_after - at_before);
    if (k % 8 == 7 || !std::isfinite(t)) t = before + 0.5 * (after - before);
    t = sense * std::clamp(sense * t, sense * before + smallest, sense * after - smallest);
    Sample between;
    if (StepReport report = read(t, between); !report.ok()) return report;
    const double value_there = value(event, between);
    if ((value_there < 0.0) == (at_before < 0.0) && value_there != 0.0) {
      before = t;
      at_before = value_there;
      if (side == -1) at_after *= 0.5;
      side = -1;
    } else {
      after = t;
      at_after = value_there;
      hit.sample = std::move(between);
      if (side == 1) at_before *= 0.5;
      side = 1;
    }
  }
  return {};
}

}  // namespace diracstep
