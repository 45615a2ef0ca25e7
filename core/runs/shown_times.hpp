#pragma once

#include <cmath>
#include <diracstep/core/runs/run.hpp>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace diracstep {

namespace detail {

/// Relative to the step: times so close are the same.
constexpr double same_time = 1e-9;

/// How far `to` lies ahead of `from` for steps of this size.
inline double ahead(double from, double to, double size) { return size > 0.0 ? to - from : from - to; }

/// Whether a step of this size from t leads beyond `end`.
inline bool passes(double t, double size, double end) {
  return ahead(end, t + size, size) > same_time * std::abs(size);
}

inline void require_ahead(double from, double to, double size) {
  if (std::isfinite(to) && ahead(from, to, size) >= -same_time * std::abs(size)) return;
  throw Misuse("t = " + to_text(to) + " does not lie ahead of t = " + to_text(from));
}

}  // namespace detail

/// Times of the user's choice at which a motion is shown, whatever its nodes.  EventSteps hands over each
/// piece that it has accepted, a step or what of it lies before an event that acts: between the ends of a
/// piece the motion is read by a step of the method from its beginning, and at the time of an event it is
/// shown as the event has left it.  Times closer than 1e-9 of a step are the same.
class ShownTimes {
 public:
  using Read = std::function<StepReport(double t, Sample& sample)>;

  /// Of a motion that stands at `from` and takes steps of about this size.  The observer returns false where
  /// no more are wanted.  Throws Misuse for times out of order or behind `from`.
  ShownTimes(std::vector<double> times, double from, double size, Observer observer)
      : times_(std::move(times)), observer_(std::move(observer)) {
    for (const double t : times_) detail::require_ahead(std::exchange(from, t), t, size);
  }

  /// Those before the end of a piece.
  StepReport before(double end, double size, const Read& read) {
    return show([&](double t) { return detail::ahead(t, end, size) > detail::same_time * std::abs(size); },
                read);
  }

  /// Those not behind a node.
  StepReport up_to(double node, double size, const Read& read) {
    return show([&](double t) { return detail::ahead(node, t, size) <= detail::same_time * std::abs(size); },
                read);
  }

  bool wanted() const { return wanted_; }

 private:
  template <class Due>
  StepReport show(Due due, const Read& read) {
    for (; wanted_ && next_ < times_.size() && due(times_[next_]); ++next_) {
      StepReport report = read(times_[next_], sample_);
      if (!report.ok()) {
        report.failure = "reading the state at t = " + to_text(times_[next_]) + ": " +
                         (report.failure.empty() ? describe(report.solve.status) : report.failure);
        return report;
      }
      sample_.time = times_[next_];
      wanted_ = observer_(sample_);
    }
    return {};
  }

  std::vector<double> times_;
  Observer observer_;
  std::size_t next_ = 0;
  bool wanted_ = true;
  Sample sample_;
};

}  // namespace diracstep
