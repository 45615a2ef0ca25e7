#pragma once

#include <diracstep/core/numerics/path_cubic.hpp>
#include <diracstep/core/system/kinks.hpp>
#include <memory>
#include <vector>

namespace diracstep {

/// A time at which a path crosses a kink of the scene's formulas.
struct KinkCrossing {
  double time;
  int number;    ///< of the switching function, see Kinks::names; -1 where only the instant is known
  bool instant;  ///< that the time alone brings
  bool smooth;   ///< a pulse or a ramp of the time, at which nothing jumps
};

/// Finds where a run crosses the kinks that its scene knows, between the points of the run as well: pairs of
/// crossings within a step show in no sign at its ends; see SignChanges for what is found of these.
class KinkCrossings {
 public:
  /// For a motion between two times, in which the instants are looked up once.
  KinkCrossings(std::shared_ptr<const Kinks> kinks, double first, double last);

  /// Whether there is nothing to cross.
  bool none() const { return !kinks_ || (kinks_->count() == 0 && instants_.empty()); }
  /// Whether an instant lies between two times.
  bool instant_between(double a, double b) const;
  /// Those in (a, b) along the path, from values at `looks` places and between, each to `precision`, in the
  /// order of the motion.  Of a pulse or a ramp of the time its centre, and one and six of its widths beside
  /// it.
  std::vector<KinkCrossing> along(const PathCubic& path, double a, double b, int looks, double precision);

 private:
  void add_switches(const PathCubic& path, double a, double b, int looks, double precision,
                    std::vector<KinkCrossing>& found);

  std::shared_ptr<const Kinks> kinks_;
  struct Cut {
    double time, width;  ///< it counts in steps longer than `width`
    bool smooth;
  };
  std::vector<Cut> instants_;  ///< ascending by time
  Vector q_, v_, values_;
};

}  // namespace diracstep
