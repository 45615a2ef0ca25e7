#pragma once

#include <cmath>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/runs/shown_times.hpp>
#include <diracstep/core/runs/step_loop.hpp>
#include <span>

/// The runs of run.hpp, for an Integrator and an AdaptiveIntegrator alike.
namespace diracstep::detail {

/// A run of one stepper, and what it reads on its way.  `Steps` takes the steps of the stepper, perhaps with
/// checks around them, which see what is read.
template <class Stepper, class Steps, class Checks>
class RunOf {
 public:
  RunOf(Stepper& stepper, Steps steps, Momentum momentum, long every, const Observer& observer,
        Checks* checks)
      : stepper_(stepper),
        steps_(steps),
        momentum_(momentum),
        every_(every),
        observer_(observer),
        checks_(checks) {
    if (every < 1) throw Misuse("every = " + std::to_string(every) + "; 1 or more is needed");
  }

  RunReport steps(long count) {
    if (!show()) return report();
    step([count](long k) { return k < count; }, [count](long k) { return k == count; });
    return report();
  }

  /// `size()` is that of the next step.
  template <class Size>
  RunReport until(double end, Size size) {
    require_ahead(stepper_.time(), end, size());
    if (!show()) return report();
    const bool goes_on =
        step([&](long) { return !passes(stepper_.time(), size(), end); }, [](long) { return false; });
    if (goes_on && !(shown_ && is_at(end, size()))) show_motion(end, size());
    return report();
  }

  template <class Size>
  RunReport at(std::span<const double> times, Size size) {
    double last = stepper_.time();
    for (const double t : times) {
      require_ahead(last, t, size());
      last = t;
    }
    for (const double t : times) {
      last_ = step_while(
          steps_, [&](long) { return !passes(stepper_.time(), size(), t); }, [](long) { return true; });
      if (!last_.ok() || !show_motion(t, size())) break;
    }
    return report();
  }

 private:
  /// Steps and shows each point that is due; false where the run has ended before its time.
  template <class GoesOn, class Last>
  bool step(GoesOn goes_on, Last is_last) {
    bool wanted = true;
    last_ = step_while(steps_, goes_on, [&](long k) {
      shown_ = k % every_ == 0 || is_last(k);
      return wanted = !shown_ || show();
    });
    return wanted && last_.ok();
  }

  /// The current point; whether the run goes on.
  bool show() {
    shown_ = true;
    if (unread()) return true;
    read_.solve = stepper_.sample(momentum_, sample_);
    if (read_.ok()) return seen();
    read_.failure =
        "reading the state at t = " + to_text(stepper_.time()) + ": " + describe(read_.solve.status);
    return false;
  }

  bool is_at(double t, double size) const {
    return std::abs(stepper_.time() - t) <= same_time * std::abs(size);
  }

  /// The motion at a time that the next step, of this size, would pass.
  bool show_motion(double t, double size) {
    if (unread() || is_at(t, size)) return show();
    read_ = sample_at(stepper_, t, momentum_, sample_);
    return read_.ok() && seen();
  }

  bool unread() const { return !observer_ && checks_ == nullptr; }
  bool seen() {
    if (checks_ != nullptr) checks_->see(sample_);
    return !observer_ || observer_(sample_);
  }

  RunReport report() const {
    RunReport report{last_};
    if (read_.ok()) return report;
    report.last.solve = read_.solve;
    report.last.failure = read_.failure;
    return report;
  }

  Stepper& stepper_;
  Steps steps_;
  Momentum momentum_;
  long every_;
  const Observer& observer_;
  Checks* checks_;
  Sample sample_;
  StepReport last_, read_;
  bool shown_ = false;  ///< the current point
};

}  // namespace diracstep::detail
