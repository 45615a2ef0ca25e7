#pragma once

#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/event_actions.hpp>
#include <diracstep/core/runs/event_search.hpp>
#include <diracstep/core/runs/shown_times.hpp>
#include <diracstep/core/runs/step_loop.hpp>
#include <diracstep/core/runs/stepping.hpp>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace diracstep {

/// The steps of an Integrator or an AdaptiveIntegrator through the events of a scene.
///
/// A step in which an event acts is taken up to its time, the event is made true (Event), and the motion goes
/// on from there with nothing of the steps before it: so the order of the method holds across events.  Steps
/// of one size go on to the node that they were to end at; variable steps go on with their control begun
/// anew.  Where rows are switched another integrator takes over, made for the scene of the rows that are on.
///
/// Events that accumulate at a time (Zeno) end the run with a failure that says so.
template <class Stepper>
class EventSteps {
  using Stepping = detail::Stepping<Stepper>;

 public:
  /// Makes the stepper of a scene, from its start.
  using Make = std::function<std::unique_ptr<Stepper>(const std::shared_ptr<const Scene>&)>;

  /// `start` and `all` as EventActions takes them; `momentum` as points are read.  Throws Misuse as it does,
  /// and as `make` does.
  EventSteps(std::shared_ptr<const Scene> start, const std::shared_ptr<const Scene>& all,
             std::vector<Event> events, const SolverFactory& solvers, Momentum momentum, Make make)
      : make_(std::move(make)),
        momentum_(momentum),
        search_(std::move(events)),
        actions_(start, all, solvers, search_.events()),
        zeno_(search_.events().size()) {
    take(start);
    began_at_ = time();
  }
  EventSteps(const EventSteps&) = delete;
  EventSteps& operator=(const EventSteps&) = delete;
  ~EventSteps() = default;

  /// The next step, to the next node of fixed steps, or to a node or an event that acts of variable ones; or
  /// to an event that stops the run.
  StepReport step() { return step(Stepping::size(stepper())); }
  /// Fixed steps: the same with a step of another size; variable ones choose theirs.
  StepReport step(double size);

  /// The motion at a time that the next step would pass, where no event acts before it; else the run goes to
  /// the first that does, and `reached` is false.
  StepReport read_up_to(double t, Sample& sample, bool& reached);

  /// Up to so many steps, fewer where an event stops the motion, and in `end` the point where it ends or has
  /// failed.  `before` is called before each step, with the number of steps taken here.
  StepReport run(long steps, Sample& end, const std::function<void(long)>& before = {});

  /// With the forces of all rows, those that are off 0, redundant ones as forces_of_whole().
  SolveReport sample(Sample& sample) {
    const SolveReport report = stepper().sample(momentum_, sample);
    if (report.ok()) show_all_rows(sample);
    return report;
  }
  double time() const { return current_->stepper->time(); }
  /// The one that steps now; another after rows were switched.
  Stepper& stepper() { return *current_->stepper; }
  const Stepper& stepper() const { return *current_->stepper; }
  const Scene& scene() const { return Stepping::integrator(stepper()).scene(); }
  /// Of all steppers; parts of a fixed step count as one.
  Work work() const;

  /// From here on the motion is shown at these times too, which the caller keeps, by step() and
  /// read_up_to(); null: no more.  It has the same bits with and without.
  void show_at(ShownTimes* times) { shown_ = times; }
  /// Those where the motion stands; step() shows those where it begins.
  StepReport show_node();

  /// How points are read from here on.
  void read_momentum(Momentum momentum) { momentum_ = momentum; }

  const std::vector<Event>& events() const { return search_.events(); }
  const std::vector<EventHit>& hits() const { return hits_; }
  /// From the first step on, what may not be meant of the start.
  const std::vector<std::string>& notes() const { return notes_; }
  /// The last hit ends the run; it is where the motion ends.
  bool stopped() const { return stopped_; }
  const Sample& end_of_stopped() const {
    const EventHit& last = hits_.back();
    return last.after ? *last.after : last.sample;
  }
  /// Whether an event acted in the last step.
  bool acted() const { return acted_; }

  /// Fixed steps: all that the next ones depend on, as Integrator::save; hits so far are not kept.
  void save(Snapshot& to) const;
  void restore(SnapshotReader& from);

 private:
  struct Mode {
    std::shared_ptr<const Scene> scene;  ///< that the stepper was made for
    std::unique_ptr<Stepper> stepper, beside;
  };

  void take(const std::shared_ptr<const Scene>& scene) {
    current_ = &modes_[actions_.on()];
    current_->scene = scene;
    current_->beside.reset();
    current_->stepper = make_(current_->scene);
  }
  Stepper& beside() {
    if constexpr (!Stepping::on_a_grid) return stepper();
    if (!current_->beside) current_->beside = make_(current_->scene);
    return *current_->beside;
  }
  void show_all_rows(Sample& sample) const {
    if (!search_.empty()) sample.lambda = actions_.forces_of_all(scene(), sample);
  }
  detail::Node node() const {
    const Integrator& at = Stepping::integrator(stepper());
    return {at.time(), at.position(), at.momentum(), at.velocity_estimate()};
  }
  StepReport read(const detail::Node& from, double t, Sample& sample) {
    StepReport report = Stepping::read(beside(), from, t, momentum_, sample);
    if (report.ok()) show_all_rows(sample);
    return report;
  }
  StepReport show_piece(const detail::Node& from, double end) {
    if (shown_ == nullptr) return {};
    return shown_->before(end, Stepping::size(stepper()),
                          [&](double t, Sample& sample) { return read(from, t, sample); });
  }
  StepReport begin();
  std::string releases_late(const Sample& here) const;
  void note_start(const Sample& here);
  StepReport look(const detail::Node& from, const Sample& point);
  StepReport act(std::vector<EventHit> met);
  StepReport make_true(EventHit hit, std::vector<EventSearch::Left>& left);
  void add_left(std::size_t number, std::vector<EventSearch::Left>& left) const;
  void add_closing(const Sample& here, std::vector<EventHit>& due) const;
  std::vector<EventSearch::Left> at_rest_in_contact(const Sample& here) const;
  StepReport failed(std::string failure) const;
  static std::string slides(const Event& event, double t);

  static constexpr int most_at_once = 100;         // events at one time
  static constexpr long most_in_a_step = 100'000;  // that act

  Make make_;
  Momentum momentum_;
  EventSearch search_;
  EventActions actions_;
  std::vector<detail::ZenoWatch> zeno_;
  std::map<std::vector<bool>, Mode> modes_;
  Mode* current_ = nullptr;
  std::vector<EventHit> hits_;
  std::vector<std::string> notes_;
  double began_at_ = 0.0;
  bool begun_ = false, acted_ = false, stopped_ = false;
  long steps_ = 0, acts_ = 0;
  Sample after_;  ///< the last event that acted
  ShownTimes* shown_ = nullptr;
};

/// For EventSteps of one size: integrators of a method and a step.  The registry must outlive it.
inline EventSteps<Integrator>::Make integrators(const Registry& registry, SolverFactory solvers,
                                                IntegratorOptions options) {
  return [&registry, solvers = std::move(solvers),
          options = std::move(options)](const std::shared_ptr<const Scene>& scene) {
    return std::make_unique<Integrator>(scene, registry, solvers, options);
  };
}

template <class Stepper>
StepReport EventSteps<Stepper>::step(double size) {
  acted_ = false;
  if (search_.empty() && shown_ == nullptr) return Stepping::step(stepper(), size);
  if (!begun_ && !search_.empty())
    if (StepReport report = begin(); !report.ok()) return report;
  const double end = time() + size;
  const long acts_at_start = acts_;
  for (bool first = true;; first = false) {
    StepReport report = show_node();
    if (!report.ok()) return report;
    const detail::Node from = node();
    if constexpr (Stepping::on_a_grid)
      report = first ? Stepping::step(stepper(), size) : Stepping::step_to(stepper(), end);
    else
      report = Stepping::step(stepper(), size);
    if (!report.ok()) return report;
    if (search_.empty()) return show_piece(from, time());
    Sample here;
    report.solve = sample(here);
    if (!report.ok()) return failed(std::string("reading the state: ") + describe(report.solve.status));
    const long before = acts_;
    if (report = look(from, here); !report.ok()) return report;
    if (acts_ - acts_at_start > most_in_a_step)
      return failed("more than " + std::to_string(most_in_a_step) + " events act in the step to t = " +
                    to_text(end, 10) + ", the last at t = " + to_text(time(), 10) +
                    ": they switch to and fro; leave a wider band between them, or take smaller steps");
    const bool ends_here = stopped_ || acts_ == before || !Stepping::on_a_grid;
    if (ends_here || std::abs(end - time()) <= 1e-9 * std::abs(size)) {
      ++steps_;
      return report;
    }
  }
}

template <class Stepper>
StepReport EventSteps<Stepper>::run(long steps, Sample& end, const std::function<void(long)>& before) {
  const auto goes_on = [&](long taken) {
    const bool next = taken < steps && !stopped_;
    if (next && before) before(taken);
    return next;
  };
  StepReport report = step_while(*this, goes_on, [](long) { return true; });
  if (!report.ok() && report.failure.empty()) report.failure = describe(report.solve.status);
  if (stopped_) {
    end = end_of_stopped();
  } else if (const SolveReport reading = sample(end); report.ok() && !reading.ok()) {
    report.solve = reading;
    report.failure = std::string("reading the end: ") + describe(reading.status);
  }
  return report;
}

template <class Stepper>
StepReport EventSteps<Stepper>::read_up_to(double t, Sample& sample, bool& reached) {
  acted_ = false;
  reached = true;
  StepReport report;
  if (!begun_ && !search_.empty())
    if (report = begin(); !report.ok()) return report;
  if (report = show_node(); !report.ok()) return report;
  const detail::Node from = node();
  if (report = read(from, t, sample); !report.ok()) return report;
  const long before = acts_;
  report = search_.empty() ? show_piece(from, t) : look(from, sample);
  reached = !stopped_ && acts_ == before;
  if (!report.ok() || !reached || shown_ == nullptr) return report;
  return shown_->up_to(t, Stepping::size(stepper()), [&](double, Sample& there) {
    there = sample;
    return StepReport{};
  });
}

template <class Stepper>
StepReport EventSteps<Stepper>::show_node() {
  if (shown_ == nullptr) return {};
  const double node = stopped_ ? end_of_stopped().time : time();
  return shown_->up_to(node, Stepping::size(stepper()), [&](double, Sample& there) {
    StepReport report;
    if (stopped_)
      there = end_of_stopped();
    else
      report.solve = sample(there);
    return report;
  });
}

/// For events from a node to a point; those that are met are made true.
template <class Stepper>
StepReport EventSteps<Stepper>::look(const detail::Node& from, const Sample& point) {
  const auto between = [&](double t, Sample& sample) { return read(from, t, sample); };
  if (StepReport report = search_.see(point, between); !report.ok()) {
    if (report.failure.empty()) report.failure = describe(report.solve.status);
    report.failure = "looking for events before t = " + to_text(point.time) + ": " + report.failure;
    return report;
  }
  const auto ends = std::ranges::find_if(search_.met(), [&](const EventHit& hit) {
    return events()[hit.event].acts() || events()[hit.event].stop;
  });
  const double end = ends != search_.met().end() ? ends->sample.time : point.time;
  if (StepReport report = show_piece(from, end); !report.ok()) return report;
  const auto acts = [&](const EventHit& hit) { return events()[hit.event].acts(); };
  if (std::ranges::any_of(search_.met(), acts)) return act(std::move(search_.met()));
  for (EventHit& hit : search_.met()) {
    stopped_ = stopped_ || events()[hit.event].stop;
    hits_.push_back(std::move(hit));
    if (stopped_) break;
  }
  return {};
}

}  // namespace diracstep

#include <diracstep/core/runs/event_steps_acting.hpp>  // the rest of the definitions
