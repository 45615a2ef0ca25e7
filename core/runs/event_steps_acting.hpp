#pragma once

#include <diracstep/core/runs/event_steps.hpp>

/// How EventSteps makes events true, and what it tells and saves.
namespace diracstep {

template <class Stepper>
StepReport EventSteps<Stepper>::failed(std::string failure) const {
  StepReport report;
  report.solve.status = SolveStatus::refused;
  report.time = time();
  report.failure = std::move(failure);
  return report;
}

template <class Stepper>
std::string EventSteps<Stepper>::slides(const Event& event, double t) {
  return "event '" + event.name + "' acts again and again at t = " + to_text(t, 10) +
         ", and no time passes: what is set there turns the motion back to where it is set (sliding mode), "
         "from both sides; leave a band between the events, make the force steep instead of a jump, as "
         "tanh(g/width), or hold the motion there by a row that is switched on";
}

/// A start at which a row is on that an event should have switched off before.
template <class Stepper>
std::string EventSteps<Stepper>::releases_late(const Sample& here) const {
  const std::vector<bool> awake = actions_.awake();
  for (std::size_t k = 0; k < events().size(); ++k) {
    const Event& event = events()[k];
    if (event.off.empty() || !event.at || !awake[k] || event.direction == Event::Direction::both) continue;
    if (event.condition && !(event.condition(here.point()) > 0.0)) continue;
    const double value = event.at(here.point());
    const bool beyond = event.direction == Event::Direction::falling ? value < 0.0 : value > 0.0;
    if (beyond)
      return "event '" + event.name + "': its function is " + to_text(value) +
             " at the start, already beyond the zero at which it switches row '" + event.off.front() +
             "' off; start without that row";
  }
  return {};
}

/// A zero at the start is no change of sign, which matters where the function goes from there as the event
/// waits for; and without a direction either side may be the one on which a row is to be off.
template <class Stepper>
void EventSteps<Stepper>::note_start(const Sample& here) {
  constexpr double soon = 1e-3;  // of a step
  const std::vector<bool> awake = actions_.awake();
  Sample then;
  for (std::size_t k = 0; k < events().size(); ++k) {
    const Event& event = events()[k];
    if (!event.at || event.restitution || !awake[k] || !(event.acts() || event.stop)) continue;
    if (event.condition && !(event.condition(here.point()) > 0.0)) continue;
    const double value = event.at(here.point());
    const std::string its = "event '" + event.name + "': its function is " + to_text(value) + " at the start";
    if (value == 0.0) {
      if (then.q.size() == 0 && !read(node(), here.time + soon * Stepping::size(stepper()), then).ok())
        return;
      const double side = event.at(then.point());
      const bool as_told = event.direction == Event::Direction::both      ? side != 0.0
                           : event.direction == Event::Direction::falling ? side < 0.0
                                                                          : side > 0.0;
      if (as_told)
        notes_.push_back(its +
                         ", which is no change of its sign: it does not happen there, but where the "
                         "function vanishes again");
    } else if (!event.off.empty() && event.direction == Event::Direction::both) {
      notes_.push_back(its + ", and row '" + event.off.front() +
                       "' stays on until it changes its sign; direction = \"" +
                       (value < 0.0 ? "rising" : "falling") +
                       "\" if that is meant, the other one if the row should be off there already");
    }
  }
}

/// Clocks act at the start.
template <class Stepper>
StepReport EventSteps<Stepper>::begin() {
  begun_ = true;
  Sample here;
  StepReport report;
  report.solve = sample(here);
  if (!report.ok()) return failed(std::string("reading the start: ") + describe(report.solve.status));
  for (const Event& event : events())
    if (event.restitution && event.direction == Event::Direction::falling)
      if (const double gap = event.at(here.point()); gap < 0.0)
        return failed("event '" + event.name + "': its function is " + to_text(gap) +
                      " at the start, behind the contact; it is positive where there is none (direction)");
  if (report = search_.see(here, {}); !report.ok()) return report;
  if (std::string late = releases_late(here); !late.empty()) return failed(std::move(late));
  note_start(here);
  (void)search_.go_on(here, at_rest_in_contact(here), actions_.awake(), false);
  std::vector<EventHit> due;
  add_closing(here, due);
  for (std::size_t k = 0; k < events().size(); ++k)
    if (events()[k].every > 0.0 && (!events()[k].condition || events()[k].condition(here.point()) > 0.0))
      due.push_back({k, here});
  if (std::ranges::any_of(due, [&](const EventHit& hit) { return events()[hit.event].acts(); }))
    return act(std::move(due));
  hits_ = std::move(due);
  return {};
}

/// Makes events true that were met; those at the end are of one time.
template <class Stepper>
StepReport EventSteps<Stepper>::act(std::vector<EventHit> met) {
  std::vector<EventSearch::Left> left;
  int made = 0;
  while (!met.empty()) {
    const bool by_settings = std::ranges::all_of(met, [&](const EventHit& hit) {  // no impact, no row
      const Event& event = events()[hit.event];
      return !event.restitution && event.on.empty() && event.off.empty();
    });
    for (EventHit& hit : met) {
      const Event& event = events()[hit.event];
      stopped_ = stopped_ || event.stop;
      if (!event.acts()) {
        hits_.push_back(std::move(hit));
        continue;
      }
      if (++made > most_at_once)
        return failed("more than 100 events act at t = " + to_text(hit.sample.time, 10) + ", the last '" +
                      event.name + "': they call each other, and no time passes");
      if (made > 1)  // at the same time: it sees what the others made
        if (const SolveReport solve = sample(hit.sample); !solve.ok()) return failed(describe(solve.status));
      if (StepReport report = make_true(std::move(hit), left); !report.ok()) return report;
    }
    met.clear();
    const Sample& here = after_;
    for (EventSearch::Left& contact : left)
      contact.rate = EventActions::contact_rate(events()[contact.event], here);
    for (const std::size_t k : search_.at_zero()) add_left(k, left);
    for (const std::size_t k : search_.go_on(here, left, actions_.awake(), by_settings)) {
      const Event& event = events()[k];
      if (event.condition && !(event.condition(here.point()) > 0.0)) continue;
      if (event.restitution)
        return failed("event '" + event.name + "': its function was set to " +
                      to_text(event.at(here.point())) + " at t = " + to_text(here.time, 10) +
                      ", behind the contact, which is no impact");
      met.push_back({k, here});
    }
    add_closing(here, met);
  }
  return {};
}

/// Another event whose function of the configuration vanishes there as well, and still does behind what
/// acted.
template <class Stepper>
void EventSteps<Stepper>::add_left(std::size_t number, std::vector<EventSearch::Left>& left) const {
  constexpr double round_off = 1e-12;
  const Event& event = events()[number];
  if (!event.contact || !search_.is_zero(number, event.at(after_.point())) ||
      std::ranges::find(left, number, &EventSearch::Left::event) != left.end())
    return;
  const double rate = EventActions::contact_rate(event, after_);
  if (std::abs(rate) > round_off * after_.v.template lpNorm<Eigen::Infinity>())
    left.push_back({number, rate});
}

/// Contacts that are closed to the last bit and close further: they have no sign to change.
template <class Stepper>
void EventSteps<Stepper>::add_closing(const Sample& here, std::vector<EventHit>& due) const {
  constexpr double round_off = 1e-12;
  const std::vector<bool> awake = actions_.awake();
  for (std::size_t k = 0; k < events().size(); ++k) {
    const Event& event = events()[k];
    if (!event.restitution || !awake[k] || event.at(here.point()) != 0.0) continue;
    if (event.condition && !(event.condition(here.point()) > 0.0)) continue;
    const double side = event.direction == Event::Direction::rising ? -1.0 : 1.0;
    const double rate = side * EventActions::contact_rate(event, here);
    if (rate < -round_off * here.v.template lpNorm<Eigen::Infinity>()) due.push_back({k, here});
  }
}

/// Contacts that are closed and stay so for now: where they close without an impact, that is told.
template <class Stepper>
std::vector<EventSearch::Left> EventSteps<Stepper>::at_rest_in_contact(const Sample& here) const {
  std::vector<EventSearch::Left> left;
  for (std::size_t k = 0; k < events().size(); ++k)
    if (events()[k].restitution && events()[k].at(here.point()) == 0.0)
      left.push_back({k, EventActions::contact_rate(events()[k], here)});
  return left;
}

template <class Stepper>
StepReport EventSteps<Stepper>::make_true(EventHit hit, std::vector<EventSearch::Left>& left) {
  const Event& event = events()[hit.event];
  const double t = hit.sample.time;
  stepper().restart(t, hit.sample.q, hit.sample.p, hit.sample.v);  // where the motion ends if it cannot act
  detail::ZenoWatch& zeno = zeno_[hit.event];
  zeno.meet(t, std::abs(t - began_at_));
  if (zeno.chatters() && !event.restitution) return failed(slides(event, t));
  if (std::isfinite(zeno.limit()))
    return failed("event '" + event.name +
                  "' is met ever faster and infinitely often before t = " + to_text(zeno.limit(), 10) +
                  " (Zeno), which steps cannot pass; let a second event, with a condition on the speed, end "
                  "it: set, or on = [a row that keeps the contact]");
  EventActions::Outcome outcome = actions_.act(event, hit.sample, scene());
  if (!outcome.failure.empty()) return failed(outcome.failure);
  if (outcome.switched) {
    const auto known = modes_.find(actions_.on());
    if (known == modes_.end() || !known->second.stepper) try {
        take(actions_.scene_from(t, outcome.q, outcome.v));
      } catch (const Misuse& misuse) {
        return failed("event '" + event.name + "' at t = " + to_text(t, 10) + ": " + misuse.what());
      }
    else
      current_ = &known->second;
  }
  stepper().restart(t, outcome.q, outcome.p, outcome.v);
  acted_ = true;
  if (event.restitution && event.on.empty()) {
    std::erase_if(left, [&](const EventSearch::Left& other) { return other.event == hit.event; });
    left.push_back({hit.event, outcome.rate});
  }
  hit.impulse = outcome.impulse;
  ++acts_;
  if (const SolveReport solve = sample(after_); !solve.ok())
    return failed("reading the state after event '" + event.name + "': " + describe(solve.status));
  hit.after = after_;
  hits_.push_back(std::move(hit));
  return {};
}

template <class Stepper>
void EventSteps<Stepper>::save(Snapshot& to) const {
  if (search_.empty()) return stepper().save(to);
  to.section("events");
  to.put("begun", begun_);
  to.put("steps to nodes", static_cast<double>(steps_));
  to.put("began at", began_at_);
  for (const bool on : actions_.on()) to.put("row is on", on);
  const Start& start = scene().start;
  to.put("start of the rows' time", start.time);
  to.put("start of the rows' position", start.q);
  to.put("start of the rows' velocity", start.v);
  search_.save(to);
  stepper().save(to);
}

template <class Stepper>
void EventSteps<Stepper>::restore(SnapshotReader& from) {
  if (search_.empty()) return stepper().restore(from);
  from.section("events");
  begun_ = from.flag("begun");
  steps_ = from.whole_number("steps to nodes", 1L << 53);
  began_at_ = from.number("began at");
  std::vector<bool> on = actions_.on();
  const std::vector<bool> at_start = on;
  for (auto&& row : on) row = from.flag("row is on");
  actions_.set_on(on);
  Start start = scene().start;
  start.time = from.number("start of the rows' time");
  from.read("start of the rows' position", start.q);
  from.read("start of the rows' velocity", start.v);
  if (on != at_start) take(actions_.scene_from(start.time, start.q, start.v));
  search_.restore(from, actions_.awake());
  stepper().restore(from);
  if (Sample here; begun_ && sample(here).ok()) search_.stand_at(here);
}

template <class Stepper>
Work EventSteps<Stepper>::work() const {
  Work work;
  for (const auto& [on, mode] : modes_)
    if (mode.stepper) work.add(mode.stepper->work());
  if (Stepping::on_a_grid && !search_.empty()) work.steps = steps_;
  return work;
}

}  // namespace diracstep
