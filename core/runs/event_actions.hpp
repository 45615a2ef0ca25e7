#pragma once

#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/sample.hpp>
#include <diracstep/core/runs/event_search.hpp>
#include <diracstep/core/system/event.hpp>
#include <diracstep/core/system/scene.hpp>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// What events make of a point of a motion, and which rows of the scene are on.
class EventActions {
 public:
  /// `start` holds the rows that are on at the start, `all` in addition those that are off; null where no row
  /// is ever switched.  Both need a Lagrangian or a Hamiltonian that is not degenerate.  Throws Misuse where
  /// an event names a row, a coordinate or a contact that `all` has not.
  EventActions(const std::shared_ptr<const Scene>& start, const std::shared_ptr<const Scene>& all,
               SolverFactory solvers, const std::vector<Event>& events);

  /// By event.  One that would only switch on rows that are on, or off rows that are off, sleeps.
  std::vector<bool> awake() const;

  /// A point after an event, with a momentum and velocity that fulfil the rows that are on.
  struct Outcome {
    std::string failure;  ///< empty, or why there is none
    Vector q, p, v;
    double impulse = 0.0;   ///< Λ_c
    double rate = 0.0;      ///< A_c v⁺ + b_c, at which a contact is left
    bool switched = false;  ///< other rows are on than before
  };
  /// `current` is the scene as the steps take it, with the rows that are on before.  Rows that the event
  /// switches are switched where it succeeds.
  Outcome act(const Event& event, const Sample& at, const Scene& current);

  /// A_c v + b_c.
  static double contact_rate(const Event& event, const Sample& at);

  /// The scene of the rows that are on, starting at a point.
  std::shared_ptr<const Scene> scene_from(double t, const Vector& q, const Vector& v) const;
  /// By row of `all`.
  const std::vector<bool>& on() const { return on_; }
  void set_on(const std::vector<bool>& on) { on_ = on; }

  /// The forces of all rows at a point of a scene that is stepped, 0 where they are off; redundant ones as
  /// forces_of_whole().
  Vector forces_of_all(const Scene& stepped, const Sample& at) const;

 private:
  /// The scene of these rows from a start, without redundant ones.  Which are left out is found where the
  /// rows are first on, and kept.
  std::shared_ptr<const Scene> scene_with(const std::vector<bool>& on, const Start& start) const;
  /// Puts q onto the rows of a scene where it is off by no more than the round-off of the time since the
  /// start.
  void settle(const Scene& scene, const Sample& at, Vector& q) const;
  std::size_t row(const std::string& name) const;

  std::shared_ptr<const Scene> start_, all_;
  bool by_momentum_;  ///< what is set are momenta
  SolverFactory solvers_;
  const std::vector<Event>& events_;
  std::vector<std::string> names_;  ///< of all rows
  std::vector<bool> on_;
  mutable std::map<std::vector<bool>, std::shared_ptr<const Scene>> known_;  ///< of scene_with()
};

namespace detail {

/// Watches one event: whether it comes ever faster, or again and again while no time passes.
class ZenoWatch {
 public:
  /// The event was met at t; `scale` is the time that has passed.
  void meet(double t, double scale) {
    const double gap = std::abs(t - last_);
    at_once_ = gap <= round_off * std::max(std::abs(t), scale) ? at_once_ + 1 : 0;
    shrinking_ = std::isfinite(gap) && gap < slowest * gap_ ? shrinking_ + 1 : 0;
    const double ratio = gap / gap_, left = (t - last_) * ratio / (1.0 - ratio);
    limit_ = shrinking_ >= 3 && gap < part * scale ? t + left : std::nan("");
    last_ = t;
    gap_ = gap;
  }
  /// The time at which it would be met infinitely often where that is about to happen, else NaN.
  double limit() const { return limit_; }
  /// Met so often at one time.
  bool chatters() const { return at_once_ >= most_at_once; }

 private:
  static constexpr double slowest = 0.9999, part = 1e-9, round_off = 1e-13;
  static constexpr int most_at_once = 10;
  double last_ = std::nan(""), gap_ = std::nan(""), limit_ = std::nan("");
  int shrinking_ = 0, at_once_ = 0;
};

}  // namespace detail

}  // namespace diracstep
