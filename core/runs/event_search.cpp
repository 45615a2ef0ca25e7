#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/event_search.hpp>
#include <limits>
#include <utility>

namespace diracstep {

namespace {

constexpr double round_off_of_times = 4.0 * std::numeric_limits<double>::epsilon();
constexpr double same_instant = 1e-9;  // in steps
constexpr double round_off_of_values = 1e-13;
constexpr double just_crossed = std::numeric_limits<double>::min();  // the sign is what counts

/// Whether all that an event does is to set coordinates and states, as the relay of a controller.  Jumps of
/// the velocity are reflections, and rows hold what vanishes: these turn a motion back by intent.
bool only_sets_values(const Event& event) {
  return !event.set.empty() && !event.restitution && event.on.empty() && event.off.empty() &&
         std::ranges::none_of(event.set, &Event::Setting::second);
}

}  // namespace

EventSearch::EventSearch(std::vector<Event> events) : events_(std::move(events)), watches_(events_.size()) {}

StepReport EventSearch::value(std::size_t event, const Sample& sample, double& value) const {
  StepReport report;
  value = events_[event].at(sample.point());
  if (!std::isnan(value)) return report;
  report.solve.status = SolveStatus::not_finite;
  report.failure =
      "the function of event '" + events_[event].name + "' is not a number at t = " + to_text(sample.time);
  return report;
}

bool EventSearch::changes(std::size_t event, double from, double to) const {
  const Event::Direction direction = events_[event].direction;
  const bool rising = from < 0.0 && to >= 0.0, falling = from > 0.0 && to <= 0.0;
  return (rising && direction != Event::Direction::falling) ||
         (falling && direction != Event::Direction::rising);
}

StepReport EventSearch::begin(const Sample& point) {
  begun_ = true;
  start_ = last_time_ = point.time;
  last_point_ = point;
  for (std::size_t k = 0; k < events_.size(); ++k) {
    if (!events_[k].at || !watches_[k].awake) continue;
    if (StepReport report = value(k, point, watches_[k].last); !report.ok()) return report;
  }
  return {};
}

StepReport EventSearch::see(const Sample& point, const Read& read) {
  met_.clear();
  if (!begun_) return begin(point);
  std::vector<double> here(events_.size(), 0.0);
  for (std::size_t k = 0; k < events_.size(); ++k) {
    if (!watches_[k].awake) continue;
    StepReport report = events_[k].at ? value(k, point, here[k]) : tick(k, point, read);
    if (report.ok() && events_[k].at) report = look(k, here[k], point, read);
    if (!report.ok()) return report;
  }
  if (keep_first_that_acts(point)) return {};
  for (std::size_t k = 0; k < events_.size(); ++k) {
    Watch& watch = watches_[k];
    if (!watch.awake || !events_[k].at) continue;
    watch.met_at_last = here[k] == 0.0 && std::ranges::find(met_, k, &EventHit::event) != met_.end();
    if (here[k] != 0.0) {
      watch.last = here[k];
      watch.left = false;
    }
  }
  last_time_ = point.time;
  last_point_ = point;
  return {};
}

StepReport EventSearch::look(std::size_t event, double here, const Sample& point, const Read& read) {
  Watch& watch = watches_[event];
  watch.largest = std::max(watch.largest, std::abs(here));
  if (!watch.left && std::max(std::abs(watch.last), std::abs(here)) <= round_off_of_values * watch.largest)
    return {};
  const double side = events_[event].direction == Event::Direction::rising ? -1.0 : 1.0;
  if (watch.left && events_[event].restitution && !(side * watch.last > 0.0) &&
      side * here < -round_off_of_values * watch.largest) {
    StepReport report;
    report.solve.status = SolveStatus::refused;
    report.failure = "the contact of event '" + events_[event].name +
                     "' is not left after its impact and closes again at once; on = [a row that keeps it] "
                     "would hold it";
    return report;
  }
  // A function that was left may jump back and vanish again in the same step; a contact may not.
  const bool at_once = watch.left && events_[event].restitution;
  const std::vector<double> times = at_once ? std::vector<double>{} : times_of_changes(event, here, point);
  if (!times.empty()) return look_at(times, event, here, point, read);
  if (watch.met_at_last || !changes(event, watch.last, here)) return {};
  EventHit hit{event, {}};
  const double at_point = watch.left ? here / (point.time - last_time_) : here;
  StepReport report = locate({last_time_, point.time, watch.last, at_point, watch.left}, point, read, hit);
  if (report.ok()) met_.push_back(std::move(hit));
  return report;
}

/// Whether the last of them acts or stops the run; an event whose condition does not hold is none.  Those of
/// one instant come in the order of the scene.
bool EventSearch::keep_first_that_acts(const Sample& point) {
  const double step = point.time - last_time_, sense = step >= 0.0 ? 1.0 : -1.0;
  const auto apart = [&](const EventHit& one, const EventHit& other) {
    return std::abs(one.sample.time - other.sample.time) > same_instant * std::abs(step);
  };
  std::ranges::stable_sort(met_, {}, [&](const EventHit& hit) { return sense * hit.sample.time; });
  std::vector<EventHit> kept;
  bool acting = false;
  for (auto first = met_.begin(), last = first; first != met_.end() && !acting; first = last) {
    last = std::find_if(first, met_.end(), [&](const EventHit& hit) { return apart(*first, hit); });
    std::stable_sort(first, last, [](const EventHit& a, const EventHit& b) { return a.event < b.event; });
    for (auto hit = first; hit != last; ++hit) {
      const Event& event = events_[hit->event];
      if (!event.at)
        watches_[hit->event].ticks = std::round(std::abs(hit->sample.time - start_) / event.every);
      if (event.condition && !(event.condition(hit->sample.point()) > 0.0)) continue;
      acting = acting || event.acts() || event.stop;
      kept.push_back(*hit);
    }
  }
  met_ = std::move(kept);
  at_zero_.clear();
  if (acting) mark_zeros(met_.back().sample);
  return acting;
}

/// Which functions vanish at the instant of the events that act, and on which side they are then.
void EventSearch::mark_zeros(const Sample& at) {
  constexpr double round_off_of_a_zero = 1e-12;
  for (std::size_t k = 0; k < events_.size(); ++k) {
    Watch& watch = watches_[k];
    watch.behind = 0;
    watch.at_act = 0.0;
    if (!events_[k].at || !watch.awake) continue;
    const double here = events_[k].at(at.point());
    watch.at_act = here;
    if (watch.last == 0.0) continue;
    const double slope = std::abs((here - watch.last) / (at.time - last_time_));
    watch.zero = round_off_of_a_zero * watch.largest +
                 4.0 * round_off_of_times * std::abs(at.time) * (std::isfinite(slope) ? slope : 0.0);
    if (!(std::abs(here) <= watch.zero)) continue;
    watch.at_act = 0.0;
    // Of what was met by its own bracket: it may have changed its sign before in the same step.
    const auto hit = std::ranges::find(met_, k, &EventHit::event);
    const bool known = hit != met_.end() && hit->behind != 0;
    watch.behind = known ? hit->behind : watch.last > 0.0 ? -1 : 1;
    at_zero_.push_back(k);
  }
}

/// Whether an event is due at once: what acted has turned its function back from a zero just crossed.
bool EventSearch::turned_back(std::size_t event, double rate) {
  Watch& watch = watches_[event];
  const int side = rate > 0.0 ? 1 : -1;
  if (watch.behind == 0 || rate == 0.0 || side == watch.behind) return false;
  const bool due = changes(event, watch.behind, side);
  watch.behind = side;
  return due && only_sets_values(events_[event]);
}

std::vector<std::size_t> EventSearch::go_on(const Sample& point, const std::vector<Left>& left,
                                            const std::vector<bool>& awake, bool by_settings) {
  std::vector<std::size_t> due;
  for (std::size_t k = 0; k < events_.size(); ++k) {
    Watch& watch = watches_[k];
    const bool woken = awake[k] && !watch.awake;
    watch.awake = awake[k];
    watch.met_at_last = false;
    if (!events_[k].at) {
      if (woken) set_clock(k, point.time);
      continue;
    }
    const double before = std::exchange(watch.at_act, 0.0);
    if (!watch.awake) continue;
    if (const auto found = std::ranges::find(left, k, &Left::event); found != left.end()) {
      if (turned_back(k, found->rate)) due.push_back(k);
      watch.left = true;
      watch.last = found->rate;
      continue;
    }
    const double here = events_[k].at(point.point());
    watch.last = 0.0;  // what it was before is none of this motion's
    watch.left = false;
    if (std::isnan(here)) continue;
    // What switches rows on is near its zero when they have just been switched off.
    if (woken && !events_[k].on.empty()) continue;
    watch.last = watch.at_act = here;
    watch.largest = std::max(watch.largest, std::abs(here));
    const bool beyond_round_off =
        std::max(std::abs(before), std::abs(here)) > round_off_of_values * watch.largest;
    if (by_settings && !woken && beyond_round_off && changes(k, before, here)) due.push_back(k);
    if (watch.behind != 0 && std::abs(here) <= watch.zero)
      watch.last = only_sets_values(events_[k]) ? watch.behind * just_crossed : 0.0;
    const Event::Direction direction = events_[k].direction;
    if (woken && ((direction == Event::Direction::rising && here > 0.0) ||
                  (direction == Event::Direction::falling && here < 0.0)))
      due.push_back(k);
  }
  last_time_ = point.time;
  last_point_ = point;
  return due;
}

void EventSearch::save(Snapshot& to) const {
  to.section("search for events");
  to.put("start of the search", start_);
  to.put("last point", last_time_);
  for (std::size_t k = 0; k < events_.size(); ++k) {
    const Watch& watch = watches_[k];
    to.put("value of event " + events_[k].name, watch.last);
    to.put("met at the last point", watch.met_at_last);
    to.put("left at the last point", watch.left);
    to.put("ticks", watch.ticks);
    to.put("largest value", watch.largest);
  }
}

void EventSearch::restore(SnapshotReader& from, const std::vector<bool>& awake) {
  from.section("search for events");
  begun_ = true;
  start_ = from.number("start of the search");
  last_time_ = from.number("last point");
  for (std::size_t k = 0; k < events_.size(); ++k) {
    Watch& watch = watches_[k];
    watch.awake = awake[k];
    watch.last = from.number("value of event " + events_[k].name);
    watch.met_at_last = from.flag("met at the last point");
    watch.left = from.flag("left at the last point");
    watch.ticks = from.number("ticks");
    watch.largest = from.number("largest value");
  }
}

}  // namespace diracstep
