#pragma once

#include <cmath>
#include <diracstep/core/adaptive/adaptive_event_steps.hpp>
#include <diracstep/core/adaptive/variable_run_checks.hpp>
#include <diracstep/core/runs/run.hpp>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

namespace diracstep {

/// The steps of a motion through the events of its scene with the checks of a run around them.  Behind an
/// event that acts the checks begin anew: they compare with what came before, and it breaks that.
template <class Stepper>
class CheckedMotion {
 public:
  using Checks = std::conditional_t<std::is_same_v<Stepper, Integrator>, RunChecks, VariableRunChecks>;

  /// `begin` makes the checks for the motion from where it stands, which must outlive this.
  CheckedMotion(EventSteps<Stepper>& motion, std::function<Checks()> begin)
      : motion_(motion), begin_(std::move(begin)), checks_(begin_()) {}

  /// One step of the motion.
  StepReport step() {
    if constexpr (by_integrator)
      checks_->before_step(motion_.stepper());
    else
      checks_->before_step();
    StepReport report = motion_.step();
    if (motion_.acted()) {
      renew();
    } else if (report.ok()) {
      if constexpr (by_integrator)
        checks_->after_step(motion_.stepper());
      else
        checks_->after_step();
    }
    return report;
  }

  /// EventSteps::read_up_to().
  StepReport read_up_to(double t, Sample& sample, bool& reached) {
    StepReport report = motion_.read_up_to(t, sample, reached);
    if (motion_.acted()) renew();
    return report;
  }

  /// Points of the motion, the start first.
  void see(const Sample& point) { checks_->see(point); }

  /// Where a run has come to its end.
  void finish() {
    if constexpr (by_integrator)
      checks_->finish(motion_.stepper());
    else
      checks_->finish();
  }

  /// Empty, or what was found first.
  std::string text() const { return doubt_.empty() ? checks_->text() : doubt_; }

  EventSteps<Stepper>& motion() { return motion_; }

 private:
  static constexpr bool by_integrator = std::is_same_v<Stepper, Integrator>;

  void renew() {
    doubt_ = text();
    checks_.emplace(begin_());
  }

  EventSteps<Stepper>& motion_;
  std::function<Checks()> begin_;
  std::optional<Checks> checks_;
  std::string doubt_;
};

namespace detail {

/// Lets a motion be shown at times until the end of a scope.
template <class Stepper>
class ShownWhile {
 public:
  ShownWhile(EventSteps<Stepper>& motion, ShownTimes* times) : motion_(motion) { motion.show_at(times); }
  ShownWhile(const ShownWhile&) = delete;
  ShownWhile& operator=(const ShownWhile&) = delete;
  ~ShownWhile() { motion_.show_at(nullptr); }

 private:
  EventSteps<Stepper>& motion_;
};

}  // namespace detail

/// How far a run through events goes, and what it shows.
struct EventCourse {
  long steps = 0;               ///< so many, or 0: to the time `end`
  double end = 0.0;             ///< which must lie ahead
  long every = 1;               ///< besides the start and the end
  ShownTimes* times = nullptr;  ///< shown beside these points, to their own observer; it may end the run
};

/// Runs until the end, an event that stops the motion, a failure or `goes_on` returning false, and shows
/// points to the observer, if there is one; false from that ends it too.  Where an event stops the motion its
/// point is the last one.  Where `end` lies between two nodes the motion is read there, as by
/// EventSteps::read_up_to().
template <class Stepper>
StepReport run_through_events(CheckedMotion<Stepper>& checked, const EventCourse& course,
                              const Observer& observer, const std::function<bool()>& goes_on) {
  constexpr bool on_a_grid = detail::Stepping<Stepper>::on_a_grid;
  constexpr double same_time = on_a_grid ? 1e-9 : 0.0;  // in steps
  EventSteps<Stepper>& motion = checked.motion();
  Sample here;
  bool wanted = true, at_end = false;
  const auto show = [&] {
    checked.see(here);
    wanted = !observer || observer(here);
  };
  const auto goes = [&] {
    return wanted && (course.times == nullptr || course.times->wanted()) && goes_on();
  };
  const detail::ShownWhile<Stepper> shown(motion, course.times);
  // In steps of the next one's size.
  const auto left = [&] {
    return (course.end - motion.time()) / detail::Stepping<Stepper>::size(motion.stepper());
  };
  StepReport report;
  report.solve = motion.sample(here);
  if (report.ok()) show();
  const double round_off =
      4.0 * std::numeric_limits<double>::epsilon() * std::max(std::abs(course.end), std::abs(here.time));
  for (long taken = 0; report.ok() && !motion.stopped() && !at_end && goes();) {
    const bool read = course.steps == 0 && left() < 1.0 - same_time;
    report = read ? checked.read_up_to(course.end, here, at_end) : checked.step();
    if (!report.ok() || motion.stopped()) break;
    if (!read) at_end = course.steps > 0 ? taken + 1 == course.steps : on_a_grid && left() <= same_time;
    if (!read || !at_end) report.solve = motion.sample(here);
    // What acted at the end was the last: from there on no time passes.
    at_end = at_end || (read && std::abs(course.end - motion.time()) <= round_off);
    if (report.ok() && (at_end || ++taken % course.every == 0)) show();
  }
  if (motion.stopped()) {
    here = motion.end_of_stopped();
    show();
  } else if (at_end && report.ok()) {
    checked.finish();
  }
  if (report.ok()) report = motion.show_node();
  if (!report.ok() && report.failure.empty()) report.failure = describe(report.solve.status);
  return report;
}

}  // namespace diracstep
